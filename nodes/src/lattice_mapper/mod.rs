//! `lattice_mapper`: quantizes clouds of the map frame into an occupied voxel list on a lattice.
//!
//! [`LatticeMapper`] is a state machine without I/O; [`node`] connects it to DDS.

mod autosave;
mod corrected;
mod counts;
mod datum;
mod free_options;
mod free_space;
mod keyframe;
mod map_folder;
pub mod node;
mod occupancy;
mod octomap;
mod octree;
mod operations;
mod options;
mod outputs;
mod parameters;
mod plan;
mod refusal;
mod report;
mod services;
mod unmapped;

pub use corrected::{CorrectedDrive, CorrectionCounts};
pub use counts::MapperCounts;
pub use free_options::{FreeSpaceMethod, MappedFreeSpace};
pub use operations::LoadRefusal;
pub use options::{MapPayload, MapperOptions, cube_m3};
pub use parameters::declare;
pub use refusal::CloudRefusal;
pub use report::MapperReport;

use lattice_core::cloud::{Cloud, CloudLimits};
use lattice_core::lattice::MortonKey;
use lattice_core::query::Shells;
use lattice_core::raycast::FreeSpaceError;
use lattice_core::voxels::{Changes, Distortion, VoxelList, VoxelStore};
use lattice_msgs::geographic_msgs::{GeoPoint, GeoPointStamped};
use lattice_msgs::lattice::LatticeMapUpdate;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use nalgebra::Vector3;
use std::sync::{Arc, OnceLock};

use self::free_space::FreeSpace;
use self::occupancy::OccupancyMap;
use crate::convert::{cloud, geometry, map, semantic, viewpoint};
use crate::hurry::Hurry;
use crate::stamps::StampGate;

/// Builds one occupied voxel list, and its updates for followers.
pub struct LatticeMapper {
    options: MapperOptions,
    /// Empty with [`MapPayload::Occupancy`].
    list: VoxelList,
    occupancy: Option<OccupancyMap>,
    free_space: Option<FreeSpace>,
    epoch: u64,
    sequence: u64,
    /// Checksum of the updates of this epoch.
    history: map::History,
    origin: Option<GeoPoint>,
    last_stamp_ns: i64,
    /// Present if voxels expire.
    stamps: Option<StampGate>,
    /// Stamp of the last removal of expired voxels.
    forgot_at_ns: i64,
    counts: MapperCounts,
    /// Search shells for queries, created at the first one.
    shells: OnceLock<Arc<Shells>>,
    hurry: Hurry,
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

    /// Quantizes a cloud of the map frame into the list.
    pub fn on_cloud(&mut self, message: &PointCloud2) -> Result<(), CloudRefusal> {
        self.counts.clouds_in += 1;
        let frame = message.header.frame_id.trim_start_matches('/');
        if frame != self.options.map_frame {
            self.counts.clouds_wrong_frame += 1;
            return Err(CloudRefusal::Frame {
                found: frame.chars().take(64).collect(),
                expected: self.options.map_frame.clone(),
            });
        }
        let limits = CloudLimits {
            max_points: self.options.max_cloud_points,
        };
        let cloud = cloud::cloud_from_message(message, &limits, &self.list.datum_m())
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.choose_datum(&cloud);
        // Everything that can be rejected is read before any voxel changes.
        let labels = self.labels_of(message)?;
        let viewpoints = self.viewpoints_of(message, &limits)?;
        // The first stamp has no reference: nothing expires by it.
        let ages = (self.stamps.as_ref()).is_some_and(|stamps| !stamps.is_new());
        let stamp_ns = cloud.stamp_ns;
        if (self.stamps.as_mut()).is_some_and(|stamps| !stamps.passes(stamp_ns)) {
            self.counts.clouds_stamp_jump += 1;
            return Err(CloudRefusal::Stamp {
                stamp_ns,
                step_ns: stamp_ns.saturating_sub(self.last_stamp_ns),
            });
        }
        if (self.free_space.as_ref()).is_some_and(|free| free.is_complete(cloud.stamp_ns)) {
            self.clear_rays();
        }
        let report = match (&mut self.occupancy, labels) {
            (Some(occupancy), _) => occupancy.insert(&cloud),
            (None, None) => self.list.insert(&cloud),
            (None, Some(labels)) => self.list.insert_labelled(&cloud, &labels),
        };
        self.counts.add(&report);
        self.last_stamp_ns = cloud.stamp_ns;
        if ages {
            self.forget_old();
        }
        if let Some(viewpoints) = viewpoints {
            self.add_rays(&cloud, &viewpoints);
        }
        Ok(())
    }

    /// Labels of the points, empty for a cloud without them; `None` if labels are not kept.
    fn labels_of(&mut self, message: &PointCloud2) -> Result<Option<Vec<u16>>, CloudRefusal> {
        let (Some(options), None) = (&self.options.labels, &self.occupancy) else {
            return Ok(None);
        };
        let most = self.options.max_cloud_points;
        let labels = semantic::labels_from_message(message, most, options)
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.counts.clouds_unlabelled += u64::from(labels.is_none());
        Ok(Some(labels.unwrap_or_default()))
    }

    /// Viewpoint of each point; `None` if free space is off or the cloud has none.
    fn viewpoints_of(
        &mut self,
        message: &PointCloud2,
        limits: &CloudLimits,
    ) -> Result<Option<Vec<Vector3<f64>>>, CloudRefusal> {
        if self.free_space.is_none() {
            return Ok(None);
        }
        let viewpoints = viewpoint::viewpoints_from_message(message, limits)
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.counts.clouds_no_viewpoint += u64::from(viewpoints.is_none());
        Ok(viewpoints)
    }

    /// Clears along the rays of the sweep.
    fn clear_rays(&mut self) {
        if let Some(free_space) = &mut self.free_space {
            let report = match &mut self.occupancy {
                Some(occupancy) => free_space.clear(occupancy),
                None => free_space.clear(&mut self.list),
            };
            self.counts.add_rays(&report);
        }
    }

    fn add_rays(&mut self, cloud: &Cloud, viewpoints: &[Vector3<f64>]) {
        let Some(free_space) = &mut self.free_space else {
            return;
        };
        match &self.occupancy {
            Some(occupancy) => free_space.add(occupancy, cloud, viewpoints),
            None => free_space.add(&self.list, cloud, viewpoints),
        }
        if free_space.is_cloud_by_cloud() {
            self.clear_rays();
        }
    }

    /// Removes expired voxels, each time a sixteenth of their age limit has passed.
    fn forget_old(&mut self) {
        let (age, now) = (self.options.forget_after_ns, self.last_stamp_ns);
        // Time goes back when a log is replayed.
        if age == 0 || now.abs_diff(self.forgot_at_ns) < age.unsigned_abs() / 16 {
            return;
        }
        self.forgot_at_ns = now;
        let forgotten = self.list.forget_before(now.saturating_sub(age));
        self.counts.voxels_forgotten += forgotten.unwrap_or(0) as u64;
    }

    /// Removes all voxels and begins a new epoch.
    pub fn reset(&mut self, epoch: u64) {
        self.list.clear();
        if let Some(occupancy) = &mut self.occupancy {
            occupancy.clear();
        }
        self.begin(epoch);
    }

    fn begin(&mut self, epoch: u64) {
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

    fn take_changes(&mut self) -> Changes {
        match &mut self.occupancy {
            Some(occupancy) => occupancy.take_changes(),
            None => self.list.take_changes(),
        }
    }

    /// Changes since the last update, as one step of the sequence; empty when there are none.
    pub fn take_update(&mut self) -> Vec<LatticeMapUpdate> {
        let changes = self.take_changes();
        if changes.changed.is_empty() && changes.removed.is_empty() {
            return Vec::new();
        }
        let previous = self.sequence;
        self.sequence += 1;
        let (stamp, list) = (self.stamp(), &self.list);
        let mut messages = match &self.occupancy {
            Some(_) => {
                map::update_of_cells(list.lattice(), list.datum_m(), &changes, previous, &stamp)
            }
            None => map::update(list, &changes, previous, &stamp),
        };
        let voxels = self.cells().len();
        self.history = map::sign(&mut messages, self.history, self.sequence, voxels);
        self.counts.updates += 1;
        messages
    }

    /// Cell centres in the map frame, with the number of points (1 if not kept) as `intensity` and,
    /// if labels are kept, the most frequent one as `label`.
    pub fn centers(&self) -> PointCloud2 {
        let voxels: Vec<(MortonKey, u32)> = match &self.occupancy {
            Some(cells) => (cells.sorted_keys().into_iter())
                .map(|key| (key, 1))
                .collect(),
            None => (self.list.sorted().into_iter())
                .map(|(key, voxel)| (key, voxel.count))
                .collect(),
        };
        let labelled = self.list.payload().labels;
        let mut fields = cloud::xyz_fields(PointField::FLOAT32, 4);
        fields.push(cloud::field("intensity", 12, PointField::FLOAT32));
        if labelled {
            fields.push(cloud::field("label", 16, PointField::UINT16));
        }
        let point_step = 4 * fields.len() as u32;
        let mut data = Vec::with_capacity(voxels.len() * point_step as usize);
        for (key, count) in &voxels {
            let center = self.list.center_m(*key);
            for v in [center.x, center.y, center.z, f64::from(*count)] {
                data.extend_from_slice(&(v as f32).to_le_bytes());
            }
            if labelled {
                let (label, _) = map::main_label(&self.list, *key);
                // Padded to four bytes.
                data.extend_from_slice(&u32::from(label).to_le_bytes());
            }
        }
        cloud::dense_cloud(self.header(), fields, point_step, voxels.len(), data)
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

    fn header(&self) -> lattice_msgs::std_msgs::Header {
        geometry::header(&self.options.map_frame, self.last_stamp_ns)
    }

    fn stamp(&self) -> map::MapStamp<'_> {
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
