//! Surface of a map about one of its voxels, and rays that pass through it.

use std::collections::hash_map::Entry;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rustc_hash::FxHashMap;

use super::masks::{Mask, ScanMasks};
use super::packed::{Packed, difference};
use super::steps::Line;
use crate::lattice::{Lattice, LatticeIndex, MortonKey};
use crate::voxels::VoxelStore;

// Lengths in cell sizes (cube root of the cell volume), chosen on eight scans of KITTI 00 and one seed of the simulated
// town with passers-by; docs/free_space.md has the results on these and others.
/// Smallest extent of a surface, standard deviation.
const EXTENT: f64 = 0.25;
/// Largest thickness of a plane, standard deviation.
const THICKNESS: f64 = 0.2;
/// Depth behind a plane at which a ray has passed through it, at least; twice its thickness if that is more.
const DEPTH: f64 = 0.1;
/// Largest distance of a ray from the mean of a voxel on a plane.
const NEAR_PLANE: f64 = 0.5;
/// Largest distance of a ray from the mean of a voxel on a line or on its own.
const NEAR_LINE: f64 = 0.3;
/// Minimum number of voxels of a plane.
const PLANE_VOXELS: u32 = 4;
/// Vertical component of a ray's direction below which a level line is one of a wall, not of the ground: a planar
/// laser that is mounted level to within a degree.
const LEVEL: f64 = 0.02;
/// Horizontal component of a line's direction above which it may be one of the ground: 45 degrees.
const FLAT: f64 = 0.7;

/// Test of traversed voxels against the rays of a scan.
///
/// A scan grazes a voxel that touches a hit cell in at least a vertex, and one whose surface no ray passes through: the
/// surface is the plane or line of the means of the touching voxels, and a ray goes to the mean of the voxel that it
/// ends in.
#[derive(Clone, Debug)]
pub(super) struct Surfaces {
    touching: Vec<LatticeIndex>,
    max_bytes: usize,
    /// Voxels that are not hit and may yet be passed through, by slot of the scan's masks.
    open: Vec<Mask>,
    /// Surfaces about those that a ray has met.
    surfaces: FxHashMap<Packed, Surface>,
    passed: Vec<Packed>,
    was_full: bool,
}

impl Surfaces {
    /// Maximum memory of a voxel that a ray has met, bytes: a table at least 7/16 full, or a place in the list.
    const BYTES_PER_VOXEL: usize = (size_of::<(Packed, Surface)>() + 1) * 16 / 7;
    /// Maximum memory of a block, bytes, by the growth of a vector.
    const BYTES_PER_BLOCK: usize = 2 * size_of::<Mask>();

    /// Creates a test within a limit of memory, bytes; voxels beyond it are not passed through.
    pub(super) fn new(lattice: &Lattice, max_bytes: usize) -> Surfaces {
        Surfaces {
            touching: lattice.touching_neighbors().to_vec(),
            max_bytes,
            open: Vec::new(),
            surfaces: FxHashMap::default(),
            passed: Vec::new(),
            was_full: false,
        }
    }

    pub(super) fn bytes(&self) -> usize {
        self.open.capacity() * size_of::<Mask>()
            + self.surfaces.capacity() * (size_of::<(Packed, Surface)>() + 1)
            + self.passed.capacity() * size_of::<Packed>()
    }

    /// Voxels that the last scan passed through, each once, in no order.
    pub(super) fn passed(&self) -> &[Packed] {
        &self.passed
    }

    pub(super) fn clear(&mut self) {
        self.open.clear();
        self.surfaces.clear();
        self.passed.clear();
        self.was_full = false;
    }

    /// Adds the voxels that other rays passed through.
    pub(super) fn unite(&mut self, other: &Surfaces) {
        self.passed.extend(&other.passed);
        self.passed.sort_unstable();
        self.passed.dedup();
    }

    /// True if a voxel of the last scan was kept for lack of memory.
    pub(super) fn was_full(&self) -> bool {
        self.was_full
    }

    fn is_full(&self) -> bool {
        let voxels = self.surfaces.len() + self.passed.len();
        let blocks = self.open.len() * Self::BYTES_PER_BLOCK;
        voxels * Self::BYTES_PER_VOXEL + blocks >= self.max_bytes
    }
}

/// The voxels of a store, tested while the rays of a scan are followed.
pub(super) struct Probe<'a> {
    surfaces: &'a mut Surfaces,
    store: &'a dyn VoxelStore,
    datum_m: Vector3<f64>,
}

impl<'a> Probe<'a> {
    pub(super) fn new(surfaces: &'a mut Surfaces, store: &'a dyn VoxelStore) -> Probe<'a> {
        Probe {
            surfaces,
            datum_m: store.datum_m(),
            store,
        }
    }

    /// True for a voxel, by slot and place, that is not hit and may yet be passed through; `None` before
    /// [`Probe::read`].
    #[inline(always)]
    pub(super) fn is_open(&self, slot: usize, place: usize) -> Option<bool> {
        let open = self.surfaces.open.get(slot)?;
        Some(open.has(place))
    }

    /// Reads the voxels of new blocks of `masks` from the store, less those that are hit.
    pub(super) fn read(&mut self, masks: &ScanMasks, hits: &ScanMasks) {
        let open = &mut self.surfaces.open;
        for (slot, block) in (open.len()..).zip(masks.blocks_from(open.len())) {
            open.push(match slot {
                // The cells of refused blocks.
                0 => Mask::default(),
                _ => Mask::of_voxels(self.store, *block).without(&hits.hits_of(*block)),
            });
        }
    }

    /// Mean of a voxel, metres from lattice point 0; `None` if the cell is not occupied.
    pub(super) fn mean_m(&self, cell: Packed) -> Option<Vector3<f64>> {
        Some(self.store.mean_m(cell.key()?)? - self.datum_m)
    }

    /// Tests a ray that traverses an open voxel, which it closes if it is passed through or will never be.
    pub(super) fn meet(&mut self, hits: &ScanMasks, cell: Packed, slot: usize, line: &Line) {
        let is_full = self.surfaces.is_full();
        let Surfaces {
            was_full,
            touching,
            open,
            surfaces,
            passed,
            ..
        } = &mut *self.surfaces;
        let is_passed = match surfaces.entry(cell) {
            Entry::Occupied(known) if known.get().is_passed_by(line) => {
                known.remove();
                true
            }
            Entry::Occupied(_) => return,
            Entry::Vacant(place) => {
                let mut around = touching.iter().map(|n| cell.plus(difference(*n)));
                *was_full |= is_full;
                let is_grazed = is_full || around.any(|cell| hits.is_hit(cell));
                let about = || Surface::about(self.store, touching, cell.unpack());
                match (!is_grazed).then(about).flatten() {
                    Some(surface) if !surface.is_passed_by(line) => {
                        place.insert(surface);
                        return;
                    }
                    surface => surface.is_some(),
                }
            }
        };
        if is_passed {
            passed.push(cell);
        }
        if let Some(mask) = open.get_mut(slot) {
            mask.remove(cell.place());
        }
    }
}

/// Mean of a voxel's points, metres from the datum, and arrangement of the voxels that touch it.
#[derive(Clone, Copy, Debug)]
struct Surface {
    mean_m: Vector3<f64>,
    shape: Shape,
    cell_m: f64,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Unit normal and standard deviation along it.
    Plane {
        normal: Vector3<f64>,
        thickness_m: f64,
    },
    /// Unit direction and standard deviation across it.
    Line {
        along: Vector3<f64>,
        thickness_m: f64,
    },
    /// Single voxels, leaves.
    Other,
}

impl Surface {
    /// Surface about an occupied cell from the voxels that touch it; `None` if it is not occupied.
    fn about(
        store: &dyn VoxelStore,
        touching: &[LatticeIndex],
        at: LatticeIndex,
    ) -> Option<Surface> {
        let datum_m = store.datum_m();
        let mean_m = store.mean_m(MortonKey::pack(at)?)? - datum_m;
        let (mut count, mut sum, mut squares) = (1, Vector3::zeros(), Matrix3::zeros());
        for step in touching {
            let cell = std::array::from_fn(|axis| at[axis] + step[axis]);
            let Some(neighbor_m) = MortonKey::pack(cell).and_then(|key| store.mean_m(key)) else {
                continue;
            };
            let offset_m = neighbor_m - datum_m - mean_m;
            count += 1;
            sum += offset_m;
            squares += offset_m * offset_m.transpose();
        }
        let mean_offset_m = sum / f64::from(count);
        let covariance = squares / f64::from(count) - mean_offset_m * mean_offset_m.transpose();
        let cell_m = store.lattice().cell_volume_m3().cbrt();
        Some(Surface {
            mean_m,
            shape: Shape::of(count, covariance, cell_m),
            cell_m,
        })
    }

    /// True if a ray goes through the surface at the voxel, or close by its mean where there is no surface.
    ///
    /// A ray that grazes a surface stays on the side of the sensor until it ends there.
    fn is_passed_by(&self, line: &Line) -> bool {
        let to_mean = self.mean_m - line.origin_m;
        let offset_m = line.direction * to_mean.dot(&line.direction) - to_mean;
        let is_within = |offset_m: Vector3<f64>, limit: f64| offset_m.norm() < limit * self.cell_m;
        let is_through = |normal: Vector3<f64>, thickness_m: f64| {
            let along = normal.dot(&line.direction);
            // At the point where the ray leaves the neighbourhood of the mean; the normal points to the sensor.
            let height_m =
                -along.signum() * normal.dot(&offset_m) - 0.5 * self.cell_m * along.abs();
            is_within(offset_m, NEAR_PLANE)
                && height_m < -(DEPTH * self.cell_m).max(2.0 * thickness_m)
        };
        match self.shape {
            Shape::Plane {
                normal,
                thickness_m,
            } => is_through(normal, thickness_m),
            Shape::Line { along, thickness_m } => {
                // A far ring of a spinning lidar on the ground: the normal about the line is unknown, and as close to
                // the vertical as it can be.
                let up = Vector3::z() - along * along.z;
                match up.norm() > FLAT && line.direction.z.abs() > LEVEL {
                    true => is_through(up.normalize(), thickness_m),
                    false => is_within(offset_m - along * along.dot(&offset_m), NEAR_LINE),
                }
            }
            Shape::Other => is_within(offset_m, NEAR_LINE),
        }
    }
}

impl Shape {
    fn of(count: u32, covariance: Matrix3<f64>, cell_m: f64) -> Shape {
        let eigen = SymmetricEigen::new(covariance);
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let [long, middle, short] = axes.map(|i| {
            (
                eigen.eigenvalues[i].max(0.0).sqrt(),
                eigen.eigenvectors.column(i),
            )
        });
        let (wide_m, flat_m) = (EXTENT * cell_m, THICKNESS * cell_m);
        if count >= PLANE_VOXELS && middle.0 > wide_m && short.0 < flat_m {
            Shape::Plane {
                normal: short.1.into_owned(),
                thickness_m: short.0,
            }
        } else if long.0 > wide_m && middle.0 <= wide_m {
            Shape::Line {
                along: long.1.into_owned(),
                thickness_m: middle.0,
            }
        } else {
            Shape::Other
        }
    }
}
