//! Lattices of any basis: Selling reduction, exact nearest points and neighbours.
//!
//! In three dimensions every lattice has an obtuse superbase: four vectors of sum 0 with no acute angle between any
//! two. The 14 sums of its proper subsets include all Voronoi-relevant vectors (Conway & Sloane 1992, Low-dimensional
//! lattices VI), which determine the nearest point.

use nalgebra::{Matrix3, Vector3};

use super::closed_form::{ClosedForm, split, within_reach};
use super::{LatticeError, LatticeIndex};

/// Maximum number of reduction steps; beyond it a basis is too skewed.
const MAX_STEPS: usize = 10_000;
/// Largest entry of a neighbour's index in the given basis.
const MAX_ENTRY: i64 = 1000;
/// Minimum volume relative to the cubed length of the longest basis vector.
const MIN_VOLUME_SHARE: f64 = 1e-12;
/// Dot product, relative to the lengths, up to which an angle is obtuse.
const ACUTE: f64 = 1e-11;
/// Relative difference up to which squared lengths are equal.
const SAME: f64 = 1e-9;
/// Maximum number of corrections after rounding; more than one only for ties within rounding errors.
const MAX_CORRECTIONS: usize = 4;

/// Index in the given basis.
type Wide = [i64; 3];

/// Sum of superbase vectors that may lead to a nearer lattice point.
#[derive(Clone, Copy, Debug)]
struct Step {
    vector: [f64; 3],
    square: f64,
    index: Wide,
}

#[derive(Clone, Debug)]
pub(super) struct Basis {
    /// Rows that map a point (metres) to coordinates in the reduced basis.
    inverse: [[f64; 3]; 3],
    /// Reduced basis vectors, metres, and their indices in the given basis.
    vectors: [[f64; 3]; 3],
    indices: [Wide; 3],
    steps: [Step; 14],
}

impl Basis {
    /// Reduces the basis in the columns of `g` (metres).
    ///
    /// Fails if it is flat, or so skewed that a neighbour has an index beyond [`MAX_ENTRY`].
    pub(super) fn new(g: &Matrix3<f64>) -> Result<Basis, LatticeError> {
        let longest = g.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
        let share = g.determinant().abs() / (longest * longest * longest);
        if !(share >= MIN_VOLUME_SHARE && share.is_finite()) {
            return Err(LatticeError::Skewed(
                "its vectors are nearly in one plane".into(),
            ));
        }
        let superbase = obtuse_superbase(g)?;
        let steps = std::array::from_fn(|i| {
            let index = sum_of_subset(&superbase, i + 1);
            let vector = point(g, index);
            let square = vector.norm_squared();
            Step {
                vector: vector.into(),
                square,
                index,
            }
        });
        let [a, b, c, _] = superbase;
        let indices = [a, b, c];
        let vectors = indices.map(|w| <[f64; 3]>::from(point(g, w)));
        let inverse = Matrix3::from_columns(&vectors.map(Vector3::from)).try_inverse();
        let inverse = inverse
            .ok_or_else(|| LatticeError::Skewed("its vectors are nearly in one plane".into()))?;
        Ok(Basis {
            inverse: [0, 1, 2].map(|i| [inverse[(i, 0)], inverse[(i, 1)], inverse[(i, 2)]]),
            vectors,
            indices,
            steps,
        })
    }

    /// Neighbours in the given basis, each followed by its opposite: face neighbours first, then the other touching
    /// cells.
    ///
    /// A cell touches the cells at the shortest vectors of each class modulo twice the lattice. It shares a face if a
    /// class has a single pair of them (Voronoi).
    pub(super) fn neighbors(&self) -> (Vec<LatticeIndex>, Vec<LatticeIndex>) {
        let mut classes: [Vec<(f64, LatticeIndex)>; 8] = Default::default();
        for code in 0..343 {
            let k = [code % 7 - 3, code / 7 % 7 - 3, code / 49 - 3_i64];
            let class = k.iter().fold(0, |class, i| 2 * class + (i & 1) as usize);
            let w = combine(&self.indices, k).map(|i| i as i32);
            let square = self.reduced_point(k.map(|i| i as f64)).norm_squared();
            // One of each pair.
            if let (true, Some(members)) = (w > [0; 3], classes.get_mut(class)) {
                members.push((square, w));
            }
        }
        let (mut faces, mut others) = (Vec::new(), Vec::new());
        for mut members in classes.into_iter().skip(1) {
            let least = members.iter().map(|m| m.0).fold(f64::MAX, f64::min);
            members.retain(|m| m.0 <= least * (1.0 + SAME));
            let list = if members.len() == 1 {
                &mut faces
            } else {
                &mut others
            };
            list.append(&mut members);
        }
        let pairs = |mut half: Vec<(f64, LatticeIndex)>| {
            half.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            half.into_iter()
                .flat_map(|(_, w)| [w, w.map(|i| -i)])
                .collect()
        };
        (pairs(faces), pairs(others))
    }

    #[inline(always)]
    fn reduced_point(&self, k: [f64; 3]) -> Vector3<f64> {
        let [a, b, c] = self.vectors;
        Vector3::from_fn(|i, _| a[i] * k[0] + b[i] * k[1] + c[i] * k[2])
    }
}

impl ClosedForm for &Basis {
    /// Rounds in the reduced basis, then takes the best step while one leads nearer.
    #[inline]
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]> {
        let u = self
            .inverse
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
        if !within_reach(u) {
            return None;
        }
        let parts = u.map(split);
        let mut w = combine(&self.indices, parts.map(|s| s.near));
        let mut rest: [f64; 3] = self.reduced_point(parts.map(|s| s.rest)).into();
        for _ in 0..MAX_CORRECTIONS {
            let (mut best, mut least) = (None, 0.0);
            for step in &self.steps {
                let [x, y, z] = step.vector;
                // Change of the squared distance by the step.
                let change = step.square - 2.0 * (rest[0] * x + rest[1] * y + rest[2] * z);
                if change < least {
                    (best, least) = (Some(step), change);
                }
            }
            let Some(step) = best else { break };
            w = [0, 1, 2].map(|i| w[i] + step.index[i]);
            rest = [0, 1, 2].map(|i| rest[i] - step.vector[i]);
        }
        Some(w)
    }
}

/// Selling's reduction: index of each superbase vector in the given basis.
fn obtuse_superbase(g: &Matrix3<f64>) -> Result<[Wide; 4], LatticeError> {
    let skewed = || {
        LatticeError::Skewed(format!(
            "neighbouring cells have indices beyond {MAX_ENTRY}; give shorter basis vectors"
        ))
    };
    let mut superbase = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1]];
    for _ in 0..MAX_STEPS {
        let vectors = superbase.map(|w| point(g, w));
        let mut most_acute = None;
        let mut largest = 0.0;
        for (i, a) in vectors.iter().enumerate() {
            for (j, b) in vectors.iter().enumerate().skip(i + 1) {
                let dot = a.dot(b);
                if dot > ACUTE * a.norm() * b.norm() && dot > largest {
                    (most_acute, largest) = (Some((i, j)), dot);
                }
            }
        }
        let Some((i, j)) = most_acute else {
            let sums = (1..15).map(|subset| sum_of_subset(&superbase, subset));
            let fits = sums.flatten().all(|entry| entry.abs() <= MAX_ENTRY);
            return if fits { Ok(superbase) } else { Err(skewed()) };
        };
        // -a, b, c + a, d + a have a smaller sum of squares.
        let a = superbase.get(i).copied().unwrap_or_default();
        for (k, v) in superbase.iter_mut().enumerate() {
            if k == i {
                *v = a.map(|x: i64| -x);
            } else if k != j {
                *v = [0, 1, 2].map(|axis| v[axis] + a[axis]);
            }
        }
    }
    Err(skewed())
}

/// Sum of the vectors whose bits are set.
fn sum_of_subset(superbase: &[Wide; 4], subset: usize) -> Wide {
    let chosen = superbase
        .iter()
        .enumerate()
        .filter(|(i, _)| subset >> i & 1 == 1);
    chosen.fold([0; 3], |sum, (_, v)| {
        [0, 1, 2].map(|axis| sum[axis] + v[axis])
    })
}

#[inline(always)]
fn combine(indices: &[Wide; 3], k: Wide) -> Wide {
    let [a, b, c] = indices;
    [0, 1, 2].map(|i| a[i] * k[0] + b[i] * k[1] + c[i] * k[2])
}

fn point(g: &Matrix3<f64>, w: Wide) -> Vector3<f64> {
    super::combine(g, w.map(|i| i as f64))
}
