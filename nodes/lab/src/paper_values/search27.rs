//! Eq. (2) over all 27 off-by-one differences, for many points: what the batch quantizer is measured
//! against.
//!
//! Made as fast as the method allows: single precision, squared distances, vectors of the
//! differences made once, loops that the compiler vectorises for the same instruction sets.

use lattice_core::lattice::{BlockKey, Lattice, LatticeIndex, Simd};
use nalgebra::Matrix3;

/// Points that are quantized together.
const BLOCK: usize = 128;
/// Adding this leaves a float rounded half to even with the integer in its low bits.
const ROUND: f32 = 1.5 * (1_u32 << 23) as f32;
/// Coordinates in the basis from here on have no cell; one less than the codes have.
const REACH: f32 = ((1 << 20) - 2) as f32;

/// All 27 index differences with entries -1, 0 and 1; the last entry varies fastest.
pub fn off_by_one() -> [LatticeIndex; 27] {
    std::array::from_fn(|i| [i / 9, i / 3 % 3, i % 3].map(|entry| entry as i32 - 1))
}

type Run = fn(&Constants, &[[f32; 3]; BLOCK], &mut [BlockKey; BLOCK]);

/// Three candidates that differ in the last entry.
#[derive(Clone, Copy, Debug, Default)]
struct Candidates {
    vectors: [[f32; 3]; 3],
    /// The difference plus 1, two bits an entry.
    packed: [i32; 3],
}

#[derive(Clone, Debug)]
struct Constants {
    inverse: [[f32; 3]; 3],
    generator: [[f32; 3]; 3],
    candidates: [Candidates; 9],
}

/// The nearest of the 27 lattice points around the rounded one; exact for the bases of the paper but
/// for the rounding of single precision, not for every basis.
#[derive(Clone, Debug)]
pub struct Search27 {
    constants: Constants,
    run: Run,
}

impl Search27 {
    /// For points in the axes of the map; `None` if the basis has no inverse.
    pub fn new(lattice: &Lattice, simd: Simd) -> Option<Search27> {
        let generator = lattice.generator();
        let differences = off_by_one();
        let candidate = |w: [i32; 3]| {
            let vector = generator * nalgebra::Vector3::from(w.map(f64::from));
            let packed = (w[0] + 1) | (w[1] + 1) << 2 | (w[2] + 1) << 4;
            (<[f64; 3]>::from(vector).map(|x| x as f32), packed)
        };
        let mut candidates = [Candidates::default(); 9];
        for (to, from) in candidates.iter_mut().zip(differences.as_chunks::<3>().0) {
            let three = from.map(candidate);
            *to = Candidates {
                vectors: three.map(|c| c.0),
                packed: three.map(|c| c.1),
            };
        }
        let rows = |m: &Matrix3<f64>| [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)] as f32));
        Some(Search27 {
            constants: Constants {
                inverse: rows(&generator.try_inverse()?),
                generator: rows(&generator),
                candidates,
            },
            run: match simd {
                #[cfg(target_arch = "x86_64")]
                Simd::Avx2 if Simd::detect() == Simd::Avx2 => checked_avx2,
                _ => block,
            },
        })
    }

    /// Writes the cell of each point (metres), [`BlockKey::NONE`] for those that have none; as many
    /// as the shorter of both slices.
    pub fn codes(&self, points: &[[f32; 3]], codes: &mut [BlockKey]) {
        let shorter = points.len().min(codes.len());
        let (points, rest) = points.split_at(shorter).0.as_chunks::<BLOCK>();
        let (codes, rest_codes) = codes.split_at_mut(shorter).0.as_chunks_mut::<BLOCK>();
        for (points, codes) in points.iter().zip(codes) {
            (self.run)(&self.constants, points, codes);
        }
        let (mut last, mut last_codes) = ([[f32::NAN; 3]; BLOCK], [BlockKey::NONE; BLOCK]);
        last.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
        (self.run)(&self.constants, &last, &mut last_codes);
        let written = rest_codes.iter_mut().zip(last_codes);
        written.for_each(|(to, from)| *to = from);
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
fn checked_avx2(c: &Constants, points: &[[f32; 3]; BLOCK], codes: &mut [BlockKey; BLOCK]) {
    // SAFETY: `Search27::new` takes this function only where the machine has AVX2.
    unsafe { avx2(c, points, codes) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(c: &Constants, points: &[[f32; 3]; BLOCK], codes: &mut [BlockKey; BLOCK]) {
    block(c, points, codes);
}

#[inline(always)]
fn product(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[inline(always)]
#[allow(clippy::needless_range_loop)] // Several arrays side by side.
fn block(c: &Constants, points: &[[f32; 3]; BLOCK], codes: &mut [BlockKey; BLOCK]) {
    let mut axes = [[0.0_f32; BLOCK]; 3];
    for i in 0..BLOCK {
        (axes[0][i], axes[1][i], axes[2][i]) = (points[i][0], points[i][1], points[i][2]);
    }
    let mut rounded = [[0_i32; BLOCK]; 3];
    let mut rest = [[0.0_f32; BLOCK]; 3];
    let mut inside = [0_i32; BLOCK];
    for i in 0..BLOCK {
        let u = product(&c.inverse, [axes[0][i], axes[1][i], axes[2][i]]);
        let sums = u.map(|u| u + ROUND);
        // From the differences, so that no large numbers are subtracted.
        let d = product(
            &c.generator,
            [0, 1, 2].map(|axis| u[axis] - (sums[axis] - ROUND)),
        );
        for axis in 0..3 {
            rounded[axis][i] = (sums[axis].to_bits() as i32).wrapping_sub(ROUND.to_bits() as i32);
            rest[axis][i] = d[axis];
        }
        let near = (u[0].abs() < REACH) & (u[1].abs() < REACH) & (u[2].abs() < REACH);
        inside[i] = -i32::from(near);
    }
    let mut least = [f32::INFINITY; BLOCK];
    let mut best = [0_i32; BLOCK];
    // Three candidates at a time, so that the loop is not one of loads and stores.
    for three in &c.candidates {
        for i in 0..BLOCK {
            let (mut square_i, mut best_i) = (least[i], best[i]);
            for (v, packed) in three.vectors.iter().zip(three.packed) {
                let (x, y, z) = (rest[0][i] - v[0], rest[1][i] - v[1], rest[2][i] - v[2]);
                let square = x * x + y * y + z * z;
                let nearer = square < square_i;
                square_i = if nearer { square } else { square_i };
                best_i = if nearer { packed } else { best_i };
            }
            (least[i], best[i]) = (square_i, best_i);
        }
    }
    let mut split = [[0_u32; BLOCK]; 2];
    for i in 0..BLOCK {
        let index = [0, 1, 2].map(|axis| {
            let step = (best[i] >> (2 * axis) & 3) - 1;
            rounded[axis][i].wrapping_add(step + (1 << 20)) as u32
        });
        let none = !inside[i] as u32;
        let [low, high] = BlockKey::halves(index);
        (split[0][i], split[1][i]) = (low | none, high | none);
    }
    for i in 0..BLOCK {
        codes[i] = BlockKey::from_halves([split[0][i], split[1][i]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn points(half_side_m: f32) -> Vec<[f32; 3]> {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut coordinate = || random.random_range(-half_side_m..half_side_m);
        (0..100_001)
            .map(|_| [coordinate(), coordinate(), coordinate()])
            .collect()
    }

    #[test]
    fn only_points_on_borders_differ_from_the_closed_form() {
        for kind in LatticeKind::PAPER {
            let lattice = Lattice::new(kind, 1.0).unwrap();
            let points = points(50.0);
            let mut codes = vec![BlockKey::NONE; points.len()];
            Search27::new(&lattice, Simd::detect())
                .unwrap()
                .codes(&points, &mut codes);
            let mut others = 0;
            for (p, code) in points.iter().zip(&codes) {
                let p = Vector3::from(p.map(f64::from));
                let nearest = lattice.quantize(&p).unwrap();
                let excess = (p - lattice.center(code.unpack())).norm_squared()
                    - (p - lattice.center(nearest)).norm_squared();
                assert!(excess < 1e-4, "{kind} {p}: {excess} m^2 too far");
                others += u32::from(code.unpack() != nearest);
            }
            assert!(others < 20, "{kind}: {others}");
        }
    }

    #[test]
    fn instructions_do_not_change_the_answer() {
        let lattice = Lattice::new(LatticeKind::Mcc, 0.001).unwrap();
        let points = points(200.0);
        let codes = |simd| {
            let mut codes = vec![BlockKey::NONE; points.len()];
            Search27::new(&lattice, simd)
                .unwrap()
                .codes(&points, &mut codes);
            codes
        };
        assert_eq!(codes(Simd::Portable), codes(Simd::Avx2));
    }

    #[test]
    fn points_without_a_cell_have_no_code() {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let search = Search27::new(&lattice, Simd::detect()).unwrap();
        let far = [f32::NAN, f32::INFINITY, 1e9, -3e38];
        let points = far.map(|x| [0.0, x, 0.0]);
        let mut codes = [BlockKey::pack([0; 3]).unwrap(); 5];
        search.codes(&points, &mut codes);
        assert_eq!(codes[..4], [BlockKey::NONE; 4]);
        assert_eq!(codes[4].unpack(), [0; 3], "beyond the points");
    }
}
