//! Least length of a walk by steps, where nothing is in the way.

use nalgebra::{Matrix3, Vector3};

use crate::lattice::{Lattice, LatticeIndex, corners};

/// Norm whose unit ball is the convex hull of the steps, each scaled to length 1: walks by these steps are at least as
/// long as the norm of the difference of their ends.
///
/// It is the maximum of `n . v` over the corners `n` of the polar polyhedron `n . s <= |s|`, which has one for each
/// face of the hull.
pub(super) struct StepLength {
    generator: Matrix3<f64>,
    /// Corners in the coordinates of indices; one of each pair of opposite ones. None for steps in any direction.
    corners: Vec<Vector3<f64>>,
}

impl StepLength {
    /// Creates the norm of steps in any direction.
    pub(super) fn straight(lattice: &Lattice) -> StepLength {
        StepLength {
            generator: lattice.generator(),
            corners: Vec::new(),
        }
    }

    /// Creates the norm of steps that come in pairs of opposite ones.
    pub(super) fn new(
        lattice: &Lattice,
        steps: impl IntoIterator<Item = LatticeIndex>,
    ) -> StepLength {
        let generator: Matrix3<f64> = lattice.generator();
        let direction = |w| 2.0 * lattice.center(w).normalize();
        let directions: Vec<_> = steps.into_iter().map(direction).collect();
        let first = |n: &Vector3<f64>| (n.x, n.y, n.z) > (-n.x, -n.y, -n.z);
        let corners = corners(&directions).into_iter().filter(first);
        StepLength {
            generator,
            corners: corners.map(|n| generator.transpose() * n).collect(),
        }
    }

    /// Length between two cells, metres, up to rounding.
    #[inline]
    pub(super) fn between_m(&self, from: LatticeIndex, to: LatticeIndex) -> f64 {
        let by = Vector3::from([0, 1, 2].map(|axis| f64::from(to[axis] - from[axis])));
        if self.corners.is_empty() {
            return (self.generator * by).norm();
        }
        let along = self.corners.iter().map(|corner| corner.dot(&by).abs());
        along.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::lattice::LatticeKind;
    use crate::query::shells::add;

    #[test]
    fn lengths_are_those_of_the_shortest_walks() {
        for kind in LatticeKind::ALL {
            let lattice = Lattice::new(kind, 1.0).unwrap();
            for steps in [lattice.face_neighbors(), lattice.touching_neighbors()] {
                let norm = StepLength::new(&lattice, steps.iter().copied());
                // Walks of up to six steps, in any order.
                let mut shortest = BTreeMap::from([([0; 3], 0.0)]);
                for _ in 0..6 {
                    for (w, length) in shortest.clone() {
                        for &by in steps {
                            let longer = length + lattice.center(by).norm();
                            let known = shortest.entry(add(w, by)).or_insert(f64::INFINITY);
                            *known = longer.min(*known);
                        }
                    }
                }
                let least = steps.iter().map(|by| lattice.center(*by).norm());
                let complete = 6.0 * least.fold(f64::INFINITY, f64::min);
                let (mut bounds, mut equal, mut all) = (0, 0, 0);
                for (w, length) in shortest.into_iter().filter(|(_, l)| *l <= complete) {
                    let found = norm.between_m([0; 3], w);
                    assert!(found <= length + 1e-9, "{kind} {w:?}: {found} {length}");
                    all += 1;
                    equal += usize::from(found > length - 1e-9);
                    bounds += usize::from(found >= lattice.center(w).norm() - 1e-9);
                }
                assert_eq!(
                    bounds, all,
                    "{kind}: the way as the crow flies is never longer"
                );
                assert!(equal * 10 > all * 8, "{kind}: {equal} of {all}");
            }
        }
    }
}
