//! The quantizers of Ryde & Brünig 2011 as printed: to show their errata, and to measure against.
//!
//! Nothing else uses them: [`Lattice::quantize`](lattice_core::lattice::Lattice::quantize) is exact and many times
//! faster. What is wrong as printed: eq. (1) misses the nearest point of a sixth to 7/16 of space;
//! eq. (2) needs the column 0, which eq. (4)-(7) lack; eq. (4) lacks ±(1,0,0), so that even with 0 it
//! misses 1/96 of space, and lists faces only, not all touching cells; eq. (7) lacks ±(1,1,1).

mod search27;

use lattice_core::lattice::{LatticeIndex, LatticeKind};
use nalgebra::{Matrix3, Vector3};
pub use search27::{Search27, off_by_one};

/// Generator matrix of eq. (8)-(12) with its four printed digits; `None` for a lattice outside the paper.
pub fn printed_generator(kind: LatticeKind) -> Option<Matrix3<f64>> {
    let rows = match kind {
        LatticeKind::Cubic => [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        LatticeKind::Bcc => [1.2599, 0.0, 0.63, 0.0, 1.2599, 0.63, 0.0, 0.0, 0.63],
        LatticeKind::Fcc => [1.5874, 0.7937, 0.0, 0.0, -0.7937, 0.7937, 0.0, 0.0, -0.7937],
        LatticeKind::Mcc => [
            1.0987, -0.4551, -0.1885, 0.0, 1.0, -0.5858, 0.0, 0.0, 0.9102,
        ],
        LatticeKind::Hex => [1.1776, -0.5888, 0.0, 0.0, 1.0198, 0.0, 0.0, 0.0, 0.8327],
        LatticeKind::HexOptimal | LatticeKind::Custom => return None,
    };
    Some(Matrix3::from_row_slice(&rows))
}

/// Columns of the matrix of eq. (3)-(7) in printed order, those with + first; empty for a lattice outside the paper.
///
/// Eq. (3) is elided in print; it is taken for all 27 columns, with 0, in the order that it starts in.
pub fn printed_delta(kind: LatticeKind) -> Vec<LatticeIndex> {
    let rows: [&[i32]; 3] = match kind {
        LatticeKind::Cubic => return off_by_one().to_vec(),
        LatticeKind::Fcc => [
            &[1, 0, 1, 0, 0, 1],
            &[-2, -1, -1, 0, -1, -1],
            &[-1, -1, -1, -1, 0, 0],
        ],
        LatticeKind::Bcc => [
            &[1, 0, 1, 0, 1, 0, -1],
            &[1, 0, 0, 1, 1, -1, 0],
            &[-2, -1, -1, -1, -1, 0, 0],
        ],
        LatticeKind::Mcc => [
            &[-1, 0, -1, 0, -1, 0, -1],
            &[-1, -1, 0, 0, -1, -1, 0],
            &[-1, -1, -1, -1, 0, 0, 0],
        ],
        LatticeKind::Hex => [
            &[0, -1, 0, 1, 0, 1, -1, 0, -1],
            &[-1, 0, 0, 0, 1, 1, -1, -1, 0],
            &[-1, -1, -1, -1, -1, -1, 0, 0, 0],
        ],
        LatticeKind::HexOptimal | LatticeKind::Custom => return Vec::new(),
    };
    let [x, y, z] = rows;
    let plus = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]);
    plus.clone()
        .chain(plus.map(|column| column.map(|i| -i)))
        .collect()
}

/// Quantizer by eq. (1) and (2) for a basis and a set of differences, in double precision.
#[derive(Clone, Debug)]
pub struct PaperQuantizer {
    generator: Matrix3<f64>,
    inverse: Matrix3<f64>,
    differences: Vec<(LatticeIndex, Vector3<f64>)>,
}

impl PaperQuantizer {
    /// Creates a quantizer from a basis, the columns of `generator_m` (metres), and the columns of Delta, in which 0
    /// has to be listed. `None` if the basis has no inverse.
    pub fn new(generator_m: Matrix3<f64>, delta: &[LatticeIndex]) -> Option<PaperQuantizer> {
        let differences = delta
            .iter()
            .map(|&w| (w, generator_m * Vector3::from(w.map(f64::from))));
        Some(PaperQuantizer {
            generator: generator_m,
            inverse: generator_m.try_inverse()?,
            differences: differences.collect(),
        })
    }

    /// Rounds every coordinate of `G^-1 p`, for |w| < 2^31 (eq. (1)).
    pub fn rounded(&self, p: &Vector3<f64>) -> LatticeIndex {
        let w = self.inverse * p;
        [w.x, w.y, w.z].map(|x| x.round() as i32)
    }

    /// Nearest lattice point to `p` among the rounded index plus each difference, the first of equals (eq. (2)); the
    /// rounded index if there are no differences.
    pub fn nearest(&self, p: &Vector3<f64>) -> LatticeIndex {
        let w = self.rounded(p);
        let rest = p - self.generator * Vector3::from(w.map(f64::from));
        let (mut step, mut least) = ([0; 3], f64::INFINITY);
        for (difference, vector) in &self.differences {
            let square = (rest - vector).norm_squared();
            if square < least {
                (step, least) = (*difference, square);
            }
        }
        [0, 1, 2].map(|i| w[i].wrapping_add(step[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::Lattice;

    #[test]
    fn rounds_to_the_digits_the_paper_prints() {
        for kind in LatticeKind::PAPER {
            let error =
                Lattice::new(kind, 1.0).unwrap().generator() - printed_generator(kind).unwrap();
            assert!(error.amax() < 0.5001e-4, "{kind}: {error}");
        }
    }
}
