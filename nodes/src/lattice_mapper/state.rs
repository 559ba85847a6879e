//! State of the mapper: the voxels, rays and counters.

use std::sync::{Arc, OnceLock};

use lattice_core::query::Shells;
use lattice_core::raycast::FreeSpaceError;
use lattice_core::voxels::{Changes, Distortion, VoxelList, VoxelStore};
use lattice_msgs::geographic_msgs::{GeoPoint, GeoPointStamped};

use super::counts::MapperCounts;
use super::free_space::FreeSpace;
use super::occupancy::OccupancyMap;
use super::options::{MapPayload, MapperOptions};
use crate::convert::{geometry, map};
use crate::hurry::Hurry;
use crate::stamps::StampGate;

/// Builds one occupied voxel list, and its updates for followers.
pub struct LatticeMapper {
    pub(super) options: MapperOptions,
    /// Empty with [`MapPayload::Occupancy`].
    pub(super) list: VoxelList,
    pub(super) occupancy: Option<OccupancyMap>,
    pub(super) free_space: Option<FreeSpace>,
    pub(super) epoch: u64,
    pub(super) sequence: u64,
    /// Checksum of the updates of this epoch.
    pub(super) history: map::History,
    pub(super) origin: Option<GeoPoint>,
    pub(super) last_stamp_ns: i64,
    /// Present if voxels expire.
    pub(super) stamps: Option<StampGate>,
    /// Stamp of the last removal of expired voxels.
    pub(super) forgot_at_ns: i64,
    pub(super) counts: MapperCounts,
    /// Search shells for queries, created at the first one.
    pub(super) shells: OnceLock<Arc<Shells>>,
    pub(super) hurry: Hurry,
}

impl LatticeMapper {
    /// Creates an empty map. `epoch` distinguishes it from earlier maps on the same topic.
    ///
    /// Fails if the datum is out of the lattice's range, or if the free space options
    /// are inconsistent.
    pub fn new(options: MapperOptions, epoch: u64) -> Result<Self, FreeSpaceError> {
        let (lattice, near_m) = (options.lattice.clone(), options.datum_near_m);
        let max_voxels = options.voxel_limit();
        let max_points = options.max_cloud_points;
        let free_space = FreeSpace::new(&options.free_space, &lattice, near_m, max_points)?;
        let list = VoxelList::new(lattice, near_m, max_voxels)?
            .with_payload(options.payload())
            .with_when_full(options.when_full);
        let occupancy = (options.payload == MapPayload::Occupancy)
            .then(|| OccupancyMap::new(&list, max_voxels, options.max_map_bytes));
        Ok(Self {
            stamps: options.stamp_gate(),
            options,
            list,
            occupancy,
            free_space,
            epoch,
            sequence: 0,
            history: map::History::default(),
            origin: None,
            last_stamp_ns: 0,
            forgot_at_ns: 0,
            counts: MapperCounts::default(),
            shells: OnceLock::new(),
            hurry: Hurry::default(),
        })
    }

    /// Leaves keyframes out after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.hurry = hurry.clone();
        self
    }

    /// Changes the options, except those that the map was created with.
    pub fn set_options(&mut self, options: MapperOptions) {
        let max_voxels = options.voxel_limit();
        self.list.set_bound(max_voxels, options.when_full);
        if let Some(occupancy) = &mut self.occupancy {
            occupancy.set_max_voxels(max_voxels);
        }
        if let Some(free_space) = &mut self.free_space {
            free_space.set_options(&options.free_space, options.max_cloud_points);
        }
        if self.options.forget_after_ns != options.forget_after_ns {
            self.stamps = options.stamp_gate();
        }
        self.options = options;
    }

    /// Sets the geodetic origin of the map frame, which map messages include.
    pub fn on_origin(&mut self, origin: &GeoPointStamped) {
        self.origin = Some(origin.position);
    }

    /// Removes all voxels and begins a new epoch.
    pub fn reset(&mut self, epoch: u64) {
        self.list.clear();
        if let Some(occupancy) = &mut self.occupancy {
            occupancy.clear();
        }
        self.begin(epoch);
    }

    pub(super) fn begin(&mut self, epoch: u64) {
        // The new epoch implies the removal.
        self.take_changes();
        if let Some(free_space) = &mut self.free_space {
            match &self.occupancy {
                Some(occupancy) => free_space.restart(occupancy),
                None => free_space.restart(&self.list),
            }
        }
        self.epoch = epoch;
        self.sequence = 0;
        self.history = map::History::default();
        self.last_stamp_ns = 0;
        self.stamps.as_mut().map(StampGate::clear);
        self.forgot_at_ns = 0;
    }

    /// Epoch and sequence of the list: a copy of the map is outdated once they differ.
    pub fn state(&self) -> (u64, u64) {
        let sequence = match &self.occupancy {
            Some(occupancy) => occupancy.sequence(),
            None => self.list.sequence().into(),
        };
        (self.epoch, sequence)
    }

    pub(super) fn take_changes(&mut self) -> Changes {
        match &mut self.occupancy {
            Some(occupancy) => occupancy.take_changes(),
            None => self.list.take_changes(),
        }
    }

    /// Mean squared error per dimension, mean distance and RMS of all points so far.
    pub fn distortion(&self) -> Distortion {
        self.list.distortion()
    }

    /// Counters of clouds and points, by reason of refusal.
    pub fn counts(&self) -> &MapperCounts {
        &self.counts
    }

    /// The voxels with their payload; empty with [`MapPayload::Occupancy`].
    pub fn list(&self) -> &VoxelList {
        &self.list
    }

    /// The occupied cells, whatever their payload.
    pub fn cells(&self) -> &dyn VoxelStore {
        match &self.occupancy {
            Some(occupancy) => occupancy,
            None => &self.list,
        }
    }

    pub(super) fn header(&self) -> lattice_msgs::std_msgs::Header {
        geometry::header(&self.options.map_frame, self.last_stamp_ns)
    }

    pub(super) fn stamp(&self) -> map::MapStamp<'_> {
        map::MapStamp {
            hurry: self.hurry.clone(),
            header: self.header(),
            epoch: self.epoch,
            sequence: self.sequence,
            history: self.history,
            origin: self.origin.as_ref(),
            chunk_bytes: self.options.chunk_bytes,
        }
    }
}
