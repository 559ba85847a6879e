//! Free space in the mapper: rays from the sensor to its points clear voxels of removed objects.
//!
//! The clouds of a sweep are one scan: a cell hit by any of them is not cleared by the others, and it
//! has one ray. A planar laser on a turntable then acts like a spinning scanner.

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::raycast::{
    ClearReport, FreeSpaceError, FreeSpaceMap, FreeSpaceOptions, RayBundle, RayClearer,
};
use lattice_core::voxels::VoxelStore;
use nalgebra::Vector3;
use rustc_hash::FxHashMap;

use super::free_options::{FreeSpaceMethod, MappedFreeSpace};

/// Limit of viewpoints of one sweep; points of others have no rays.
const MAX_BUNDLES: usize = 4096;

/// Rays of a sweep, and their evidence on the cells of a map.
pub(super) struct FreeSpace {
    method: Method,
    sweep_ns: i64,
    max_points: usize,
    sweep: Sweep,
}

enum Method {
    Clear(Box<RayClearer>),
    Evidence(Box<FreeSpaceMap>),
}

/// Points of the current sweep, by the cell of their viewpoint.
#[derive(Default)]
struct Sweep {
    start_ns: Option<i64>,
    /// Index in `bundles` by the cell of the viewpoint and the bits of the cloud's datum.
    places: FxHashMap<(MortonKey, [u64; 3]), usize>,
    bundles: Vec<(Vector3<f64>, Cloud)>,
    points: usize,
}

impl FreeSpace {
    /// Free space of a map, `None` if it is off.
    pub(super) fn new(
        options: &MappedFreeSpace,
        lattice: &Lattice,
        datum_near_m: Vector3<f64>,
        max_points: usize,
    ) -> Result<Option<FreeSpace>, FreeSpaceError> {
        let method = match options.method {
            FreeSpaceMethod::Off => return Ok(None),
            FreeSpaceMethod::Clear => {
                Method::Clear(Box::new(RayClearer::new(lattice, options.clear)))
            }
            FreeSpaceMethod::Evidence => {
                let options = FreeSpaceOptions {
                    evidence: options.evidence,
                    reach: options.clear.reach,
                    spare_touching: options.clear.spare_touching,
                    free_level: Some(options.free_level)
                        .filter(|level| *level > 0 || options.is_fine),
                    max_bytes: options.clear.max_bytes,
                };
                let map = FreeSpaceMap::new(lattice.clone(), datum_near_m, options)?;
                Method::Evidence(Box::new(map))
            }
        };
        Ok(Some(FreeSpace {
            method,
            sweep_ns: options.sweep_ns,
            max_points,
            sweep: Sweep::default(),
        }))
    }

    /// Changes the options, except method, memory and free level.
    pub(super) fn set_options(&mut self, options: &MappedFreeSpace, max_points: usize) {
        (self.sweep_ns, self.max_points) = (options.sweep_ns, max_points);
        match &mut self.method {
            Method::Clear(clearer) => clearer.set_options(options.clear),
            Method::Evidence(map) => {
                // Validated when the parameters were read.
                let clear = options.clear;
                let set = map.set_weights(options.evidence, clear.reach, clear.spare_touching);
                if let Err(error) = set {
                    log::error!("{error}");
                }
            }
        }
    }

    /// True if a cloud of this stamp begins another sweep, so that this one is to be cleared before
    /// its points are inserted.
    pub(super) fn is_complete(&self, stamp_ns: i64) -> bool {
        let Some(start_ns) = self.sweep.start_ns else {
            return false;
        };
        let since_ns = stamp_ns.saturating_sub(start_ns);
        // Time goes back when a log is replayed.
        since_ns >= self.sweep_ns
            || since_ns < -self.sweep_ns
            || self.sweep.points > self.max_points
    }

    /// Adds a cloud whose points are already in `store`.
    pub(super) fn add(
        &mut self,
        store: &dyn VoxelStore,
        cloud: &Cloud,
        viewpoints: &[Vector3<f64>],
    ) {
        self.sweep.start_ns.get_or_insert(cloud.stamp_ns);
        self.sweep.add(store, cloud, viewpoints);
    }

    /// True if each cloud is a scan.
    pub(super) fn is_cloud_by_cloud(&self) -> bool {
        self.sweep_ns == 0
    }

    /// Ends the sweep and clears along its rays.
    pub(super) fn clear(&mut self, store: &mut dyn VoxelStore) -> ClearReport {
        let sweep = std::mem::take(&mut self.sweep);
        let bundles = sweep.bundles.iter();
        let scan: Vec<RayBundle> = bundles
            .map(|(origin_m, ends)| RayBundle {
                origin_m: *origin_m,
                ends,
            })
            .collect();
        match &mut self.method {
            _ if scan.is_empty() => ClearReport::default(),
            Method::Clear(clearer) => clearer.clear(store, &scan),
            Method::Evidence(map) => map.clear(store, &scan),
        }
    }

    /// Drops all rays; `known` cells count as hit once.
    pub(super) fn restart(&mut self, known: &dyn VoxelStore) {
        self.sweep = Sweep::default();
        if let Method::Evidence(map) = &mut self.method {
            map.reset();
            if !known.is_empty() {
                map.insert_occupied(&known.sorted_keys());
            }
        }
    }

    /// Hits and misses of the cells, if they are counted.
    pub(super) fn evidence(&self) -> Option<&FreeSpaceMap> {
        match &self.method {
            Method::Evidence(map) => Some(map),
            Method::Clear(_) => None,
        }
    }

    /// Lattice and cells of the free level, if there is one.
    pub(super) fn free_cells(&self) -> Option<(&Lattice, Vec<MortonKey>)> {
        let map = self.evidence()?;
        let has_level = map.options().free_level.is_some_and(|level| level > 0);
        has_level.then(|| (map.free_lattice(), map.free_keys()))
    }
}

impl Sweep {
    fn add(&mut self, store: &dyn VoxelStore, cloud: &Cloud, viewpoints: &[Vector3<f64>]) {
        let datum = <[f64; 3]>::from(cloud.datum_m).map(f64::to_bits);
        let mut last: Option<(Vector3<f64>, usize)> = None;
        for (offset, viewpoint) in cloud.offsets_m.iter().zip(viewpoints) {
            let index = match last {
                Some((place, index)) if place == *viewpoint => index,
                _ => {
                    let Some(index) = self.bundle_at(store, *viewpoint, datum, cloud) else {
                        continue;
                    };
                    last = Some((*viewpoint, index));
                    index
                }
            };
            if let Some((_, ends)) = self.bundles.get_mut(index) {
                ends.offsets_m.push(*offset);
                self.points += 1;
            }
        }
    }

    /// Bundle of a viewpoint: that of the first viewpoint in the same cell.
    fn bundle_at(
        &mut self,
        store: &dyn VoxelStore,
        viewpoint: Vector3<f64>,
        datum: [u64; 3],
        cloud: &Cloud,
    ) -> Option<usize> {
        let place = (store.key_of(&viewpoint)?, datum);
        if let Some(index) = self.places.get(&place) {
            return Some(*index);
        }
        let index = self.bundles.len();
        if index >= MAX_BUNDLES {
            return None;
        }
        self.places.insert(place, index);
        let ends = Cloud {
            offsets_m: Vec::new(),
            ..*cloud
        };
        self.bundles.push((viewpoint, ends));
        Some(index)
    }
}
