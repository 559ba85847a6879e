//! Cells around a cell in order of distance.

use nalgebra::Vector3;

use super::search::{Search, slack_m};
use crate::lattice::{Lattice, LatticeIndex, MortonKey};
use crate::voxels::VoxelStore;

/// Approximate number of probed cells before a search uses sorted keys.
const PROBES: f64 = 4096.0;

/// Index differences to the cells around a cell in order of distance, up to some ten cell sides.
#[derive(Debug)]
pub struct Shells {
    lattice: Lattice,
    steps: Vec<Step>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) distance_m: f64,
    pub(super) by: LatticeIndex,
}

impl Shells {
    /// Creates the shells of a lattice.
    pub fn new(lattice: &Lattice) -> Shells {
        let ball_volume = PROBES * lattice.cell_volume_m3();
        let radius_m = (ball_volume * 0.75 * std::f64::consts::FRAC_1_PI).cbrt();
        Shells {
            steps: steps_within(lattice, radius_m),
            lattice: lattice.clone(),
        }
    }

    pub(super) fn are_of(&self, lattice: &Lattice) -> bool {
        self.lattice == *lattice
    }

    pub(super) fn len(&self) -> usize {
        self.steps.len()
    }

    /// Probes cells around the centre of the query; true if no other cell can matter.
    pub(super) fn search(&self, store: &impl VoxelStore, search: &mut impl Search) -> bool {
        let (middle, radius_m) = search.ball();
        let Some(start) = self.lattice.quantize(&middle) else {
            return false;
        };
        let inside_m = radius_m + (middle - self.lattice.center(start)).norm();
        for step in &self.steps {
            let bound_m = step.distance_m - inside_m;
            let slack_m = slack_m(inside_m, self.lattice.covering_radius_m());
            if bound_m > search.reach_m() + slack_m {
                return true;
            }
            let w = add(start, step.by);
            if store.holds(w)
                && let Some(key) = MortonKey::pack(w)
            {
                search.visit(key, &self.lattice.center(w));
            }
        }
        false
    }
}

pub(super) fn add(a: LatticeIndex, b: LatticeIndex) -> LatticeIndex {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// All lattice points within a distance of lattice point 0, by distance, then by index.
pub(super) fn steps_within(lattice: &Lattice, radius_m: f64) -> Vec<Step> {
    let reach = dual(lattice).map(|row| (row.norm() * radius_m + 1e-9) as i32);
    let mut steps = Vec::new();
    for z in -reach[2]..=reach[2] {
        for y in -reach[1]..=reach[1] {
            for x in -reach[0]..=reach[0] {
                let distance_m = lattice.center([x, y, z]).norm();
                if distance_m <= radius_m {
                    let by = [x, y, z];
                    steps.push(Step { distance_m, by });
                }
            }
        }
    }
    let order = |a: &Step, b: &Step| a.distance_m.total_cmp(&b.distance_m).then(a.by.cmp(&b.by));
    steps.sort_unstable_by(order);
    steps
}

/// Rows of the inverse generator, which map a point to its lattice index.
pub(super) fn dual(lattice: &Lattice) -> [Vector3<f64>; 3] {
    let g = lattice.generator();
    let columns = [0, 1, 2].map(|i| g.column(i).into_owned());
    let determinant = columns[0].dot(&columns[1].cross(&columns[2]));
    [0, 1, 2].map(|i| columns[(i + 1) % 3].cross(&columns[(i + 2) % 3]) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::LatticeKind;

    #[test]
    fn shells_hold_every_cell_within_their_radius() {
        for kind in LatticeKind::ALL {
            let lattice = Lattice::new(kind, 0.125).unwrap();
            let shells = Shells::new(&lattice);
            let expected = PROBES;
            let found = shells.steps.len() as f64;
            assert!((found / expected - 1.0).abs() < 0.03, "{kind}: {found}");
            let last = shells.steps.last().unwrap().distance_m;
            let wide = steps_within(&lattice, 1.3 * last);
            let inner = wide.iter().filter(|s| s.distance_m <= last).count();
            assert_eq!(inner, shells.steps.len());
            let reach = wide.iter().flat_map(|s| s.by).max().unwrap();
            let mut all = 0;
            for x in -reach - 9..=reach + 9 {
                for y in -reach - 9..=reach + 9 {
                    for z in -reach - 9..=reach + 9 {
                        all += usize::from(lattice.center([x, y, z]).norm() <= last);
                    }
                }
            }
            assert_eq!(all, shells.steps.len(), "{kind}");
        }
    }

    #[test]
    fn the_dual_undoes_the_generator() {
        for kind in LatticeKind::ALL {
            let lattice = Lattice::new(kind, 3.0).unwrap();
            let p = lattice.center([3, -5, 7]);
            let w = dual(&lattice).map(|row| row.dot(&p));
            for (found, expected) in w.into_iter().zip([3.0, -5.0, 7.0]) {
                assert!((found - expected).abs() < 1e-12, "{kind}: {w:?}");
            }
        }
    }
}
