//! Evenly spread points of a cell.

use super::report_options::Options;
use crate::paper::streams::{Purpose, stream};
use lattice_core::lattice::Lattice;
use nalgebra::Vector3;

/// Numbers of points of a cell and of independent draws.
#[derive(Clone, Copy, Debug)]
pub struct Samples {
    /// Draws, from which intervals come.
    pub draws: usize,
    /// Points of a draw along each basis vector.
    pub side: usize,
}

impl Samples {
    /// Three million points, or 110 000 in a quick run.
    pub fn new(options: &Options) -> Samples {
        let (draws, side) = if options.quick { (8, 24) } else { (24, 50) };
        Samples { draws, side }
    }

    /// Number of points of all draws.
    pub fn points(&self) -> usize {
        self.draws * self.side.pow(3)
    }

    /// Visits the points of a draw as vectors from their lattice point, metres: one random point in each
    /// of `side` cubed equal parts of what the basis spans.
    pub fn visit(
        &self,
        lattice: &Lattice,
        seed: u64,
        draw: usize,
        mut visit: impl FnMut(Vector3<f64>),
    ) {
        let mut stream = stream(seed, Purpose::Cell, draw);
        let part = lattice.generator() / self.side as f64;
        for code in 0..self.side.pow(3) {
            let (i, j) = (code % self.side, code / self.side % self.side);
            let k = code / (self.side * self.side);
            let corner = Vector3::new(i as f64, j as f64, k as f64);
            let p = part * (corner + stream.point());
            if let Some(w) = lattice.quantize(&p) {
                visit(p - lattice.center(w));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;

    #[test]
    fn points_fill_the_cell_evenly() {
        let samples = Samples { draws: 2, side: 12 };
        let lattice = Lattice::new(LatticeKind::Mcc, 1.0).unwrap();
        let (mut sum, mut n, mut farthest) = (Vector3::zeros(), 0, 0.0_f64);
        let mut others = 0;
        samples.visit(&lattice, 1, 0, |p| {
            sum += p;
            n += 1;
            farthest = farthest.max(p.norm());
        });
        samples.visit(&lattice, 1, 1, |_| others += 1);
        assert_eq!((n, others, samples.points()), (1728, 1728, 3456));
        assert!(sum.norm() / f64::from(n) < 0.02, "{sum}");
        let reach = lattice.covering_radius_m();
        assert!((0.9 * reach..=reach).contains(&farthest));
    }
}
