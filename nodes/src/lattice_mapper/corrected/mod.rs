//! A map whose poses are corrected later: clouds of an odometry are kept, and mapped anew where loops have moved them.

mod counts;
mod kept_cloud;
#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use lattice_core::cloud::CloudLimits;
use lattice_core::raycast::FreeSpaceError;
use lattice_core::voxels::Region;
use lattice_core::voxels::file::MapContents;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::{Isometry3, Vector3};

pub use self::counts::CorrectionCounts;
use self::kept_cloud::{KeptCloud, SeenCells, Thinned};
use super::refusal::CloudRefusal;
use super::state::LatticeMapper;
use crate::convert::corrections::{CorrectionsError, PlacedCorrections};

/// Edge of the cubes that keep one point each, in cell sizes.
const KEPT_PART: f64 = 0.25;
/// Displacement by a correction above which clouds are mapped again, in cell sizes. Points of a voxel lie within some
/// tenths of a cell size from its centre.
const MOVED_PART: f64 = 0.1;
/// Time spent on a corrected map after each event; scans arrive every 0.1 s.
const STEP: Duration = Duration::from_millis(30);

/// Clouds of a drive and their corrections.
pub struct CorrectedDrive {
    map_frame: String,
    max_bytes: usize,
    side_m: f64,
    corrections: Option<Followed>,
    clouds: Vec<KeptCloud>,
    bytes: usize,
    seen: SeenCells,
    /// Voxels of the map before the first cloud, which corrections do not move.
    base: Option<MapContents>,
    renewal: Option<Renewal>,
    /// False once the corrections were found to move no cloud by more than the limit.
    may_be_moved: bool,
    /// True if a mapped cloud was not kept for lack of memory.
    is_full: bool,
    counts: CorrectionCounts,
}

/// Corrections received last.
struct Followed {
    placed: PlacedCorrections,
    odom_frame: String,
    /// True if they belong to another drive than the clouds.
    is_other_drive: bool,
}

impl Followed {
    fn span_ns(&self) -> [i64; 2] {
        let anchors = self.placed.corrections.anchors();
        [anchors.first(), anchors.last()].map(|anchor| anchor.map_or(0, |anchor| anchor.stamp_ns))
    }
}

/// Corrected map under construction.
struct Renewal {
    machine: LatticeMapper,
    corrections: PlacedCorrections,
    /// Pose of the odometry frame in the map at each cloud mapped so far.
    places: Vec<Option<Isometry3<f64>>>,
}

impl CorrectedDrive {
    /// Creates a drive without clouds for the map of a state machine. `max_bytes`: memory limit of the kept clouds.
    pub fn new(machine: &LatticeMapper, max_bytes: usize) -> Self {
        let side_m = machine.options.lattice.cell_volume_m3().cbrt();
        let mut drive = Self {
            map_frame: machine.options.map_frame.clone(),
            max_bytes,
            side_m,
            corrections: None,
            clouds: Vec::new(),
            bytes: 0,
            seen: SeenCells::new(KEPT_PART * side_m),
            base: None,
            renewal: None,
            may_be_moved: false,
            is_full: false,
            counts: CorrectionCounts::default(),
        };
        drive.restart(machine);
        drive
    }

    /// Drops all clouds after the map was replaced. Voxels of the new map are not moved by corrections.
    pub fn restart(&mut self, machine: &LatticeMapper) {
        self.clouds.clear();
        self.seen.clear();
        (self.bytes, self.renewal, self.is_full) = (0, None, false);
        self.counts.clouds_unplaced = 0;
        self.base = (!machine.cells().is_empty()).then(|| machine.contents());
        if let Some(followed) = &mut self.corrections {
            followed.is_other_drive = false;
        }
    }

    /// Handles the corrections of all poses of the drive.
    pub fn on_corrections(&mut self, message: &TFMessage) -> Result<(), CorrectionsError> {
        let read = PlacedCorrections::read(message, &self.map_frame);
        let (placed, odom_frame) = read.inspect_err(|_| self.counts.corrections_refused += 1)?;
        let mut followed = Followed {
            placed,
            odom_frame,
            is_other_drive: false,
        };
        if let Some(before) = self
            .corrections
            .as_ref()
            .filter(|_| !self.clouds.is_empty())
        {
            let ([first, last], [new_first, new_last]) = (before.span_ns(), followed.span_ns());
            if before.is_other_drive || new_first != first || new_last < last {
                followed.is_other_drive = true;
                // Later corrections of this drive are not told from the one before.
                self.corrections = Some(followed);
                return Ok(());
            }
        }
        // The next segment: what it sees again may be moved otherwise.
        let last_ns = self.corrections.as_ref().map(|before| before.span_ns()[1]);
        if last_ns != Some(followed.span_ns()[1]) {
            self.seen.clear();
        }
        self.corrections = Some(followed);
        self.may_be_moved = true;
        self.count_unplaced();
        Ok(())
    }

    /// Maps a cloud given in the odometry frame, thinned, and keeps it in memory so that corrections can move it. A
    /// cloud of a submap without a known pose in the map is kept and not mapped yet.
    pub fn on_cloud(
        &mut self,
        machine: &mut LatticeMapper,
        message: &PointCloud2,
    ) -> Result<(), CloudRefusal> {
        let thinned = self.thin(machine, message).inspect_err(|refusal| {
            machine.counts.clouds_in += 1;
            match refusal {
                CloudRefusal::NoCorrections => self.counts.clouds_no_corrections += 1,
                CloudRefusal::OtherDrive => self.counts.clouds_other_drive += 1,
                CloudRefusal::Frame { .. } => machine.counts.clouds_wrong_frame += 1,
                _ => machine.counts.clouds_malformed += 1,
            }
        })?;
        machine.counts.points_not_finite += thinned.not_finite;
        machine.counts.points_in += thinned.not_finite;
        self.counts.points_thinned += thinned.thinned;
        let Some(mut cloud) = thinned.kept else {
            machine.counts.clouds_in += 1;
            return Ok(());
        };
        let place = self.place(cloud.stamp_ns);
        match &place {
            Some(place) => machine.on_cloud(&cloud.message(&self.map_frame, place))?,
            None => {
                machine.counts.clouds_in += 1;
                self.counts.clouds_unplaced += 1;
            }
        }
        cloud.placed = place;
        self.keep(cloud, machine.options.forget_after_ns);
        Ok(())
    }

    fn thin(
        &mut self,
        machine: &LatticeMapper,
        message: &PointCloud2,
    ) -> Result<Thinned, CloudRefusal> {
        let followed = self.corrections.as_ref();
        let followed = followed.ok_or(CloudRefusal::NoCorrections)?;
        let frame = message.header.frame_id.trim_start_matches('/');
        if frame != followed.odom_frame {
            return Err(CloudRefusal::Frame {
                found: frame.chars().take(64).collect(),
                expected: followed.odom_frame.clone(),
            });
        }
        if followed.is_other_drive {
            return Err(CloudRefusal::OtherDrive);
        }
        let limits = CloudLimits {
            max_points: machine.options.max_cloud_points,
        };
        let with_fields = machine.options.labels.is_some() || machine.options.keep_color;
        Ok(KeptCloud::thin(
            message,
            &limits,
            with_fields,
            &mut self.seen,
        )?)
    }

    fn keep(&mut self, cloud: KeptCloud, forget_after_ns: i64) {
        let bytes = cloud.bytes();
        if self.is_full || self.bytes + bytes > self.max_bytes {
            self.is_full = true;
            self.counts.clouds_not_kept += 1;
            // A map made anew would lack this cloud.
            self.renewal = None;
            return;
        }
        self.bytes += bytes;
        let newest_ns = cloud.stamp_ns;
        self.clouds.push(cloud);
        let oldest_ns = newest_ns.saturating_sub(forget_after_ns);
        let is_old = |cloud: &KeptCloud| cloud.stamp_ns < oldest_ns;
        // Clouds in order of time; not while a map is made of them.
        if forget_after_ns > 0 && self.renewal.is_none() && self.clouds.first().is_some_and(is_old)
        {
            self.clouds.retain(|cloud| !is_old(cloud));
            self.bytes = self.clouds.iter().map(KeptCloud::bytes).sum();
        }
    }

    /// Reason in one line why clouds are not mapped or not corrected; `None` if all are.
    pub fn problem(&self) -> Option<String> {
        let counts = &self.counts;
        let is_other = |followed: &Followed| followed.is_other_drive;
        if self.corrections.as_ref().is_some_and(is_other) {
            return Some(CloudRefusal::OtherDrive.to_string());
        }
        if self.is_full {
            let problem = "`max_kept_bytes` is reached: later corrections do not move the map";
            return Some(problem.to_owned());
        }
        (counts.clouds_unplaced > 0).then(|| {
            let clouds = counts.clouds_unplaced;
            format!("{clouds} clouds in submaps that no loop joins to the map")
        })
    }

    /// Counters of corrections.
    pub fn counts(&self) -> &CorrectionCounts {
        &self.counts
    }

    /// Removes the points of a region from the kept clouds, as the map does from its voxels.
    pub fn remove(&mut self, machine: &LatticeMapper, region: &Region) {
        let is_removed = |point_m: &Vector3<f64>| {
            let cells = machine.cells();
            let key = cells.key_of(point_m);
            key.is_some_and(|key| region.contains(&cells.center_m(key)))
        };
        for cloud in &mut self.clouds {
            cloud.retain(|point_m| !is_removed(point_m));
        }
        self.bytes = self.clouds.iter().map(KeptCloud::bytes).sum();
        self.seen.clear();
        if let Some(base) = &mut self.base {
            base.retain(|_, center_m| !region.contains(&center_m));
        }
        // It may have points of the region.
        self.may_be_moved |= self.renewal.take().is_some();
    }

    fn place(&self, stamp_ns: i64) -> Option<Isometry3<f64>> {
        self.corrections.as_ref()?.placed.map_from_odom(stamp_ns)
    }

    fn count_unplaced(&mut self) {
        let unplaced = self.clouds.iter();
        let unplaced = unplaced.filter(|cloud| self.place(cloud.stamp_ns).is_none());
        self.counts.clouds_unplaced = unplaced.count() as u64;
    }

    /// True if the corrections displace a cloud by more than `least_m`.
    fn is_moved(&self, cloud: &KeptCloud, least_m: f64) -> bool {
        match (cloud.placed, self.place(cloud.stamp_ns)) {
            (Some(from), Some(to)) => from != to && cloud.moved_m(&from, &to) > least_m,
            (from, to) => from.is_some() || to.is_some(),
        }
    }

    /// Spends up to 30 ms on a map with the newest corrections, if they move the clouds. Returns true if the map of
    /// the state machine was replaced; it then has a new epoch.
    pub fn step(
        &mut self,
        machine: &mut LatticeMapper,
        epoch: fn() -> u64,
    ) -> Result<bool, FreeSpaceError> {
        self.work(machine, epoch, Instant::now().checked_add(STEP))
    }

    /// True while a corrected map is being made.
    pub fn is_at_work(&self) -> bool {
        self.renewal.is_some()
    }

    /// Completes the map with the newest corrections, however little they move.
    pub fn finish(
        &mut self,
        machine: &mut LatticeMapper,
        epoch: fn() -> u64,
    ) -> Result<bool, FreeSpaceError> {
        let mut is_replaced = self.work(machine, epoch, None)?;
        // Corrections that came meanwhile, and small ones.
        self.may_be_moved = true;
        is_replaced |= self.work(machine, epoch, None)?;
        Ok(is_replaced)
    }

    /// Works until a time, or to the end without one.
    fn work(
        &mut self,
        machine: &mut LatticeMapper,
        epoch: fn() -> u64,
        until: Option<Instant>,
    ) -> Result<bool, FreeSpaceError> {
        let least_m = until.map_or(0.0, |_| MOVED_PART * self.side_m);
        if self.renewal.is_none() && !self.begin(machine, least_m)? {
            return Ok(false);
        }
        let Some(renewal) = &mut self.renewal else {
            return Ok(false);
        };
        for cloud in self.clouds.iter().skip(renewal.places.len()) {
            if until.is_some_and(|until| Instant::now() > until) {
                return Ok(false);
            }
            let place = renewal.corrections.map_from_odom(cloud.stamp_ns);
            if let Some(place) = &place {
                let mapped = renewal
                    .machine
                    .on_cloud(&cloud.message(&self.map_frame, place));
                // As refused at first, and counted then.
                if let Err(refusal) = mapped {
                    log::debug!("{refusal}");
                }
            }
            renewal.places.push(place);
        }
        let Some(Renewal {
            machine: renewed,
            places,
            ..
        }) = self.renewal.take()
        else {
            return Ok(false);
        };
        for (cloud, place) in self.clouds.iter_mut().zip(places) {
            cloud.placed = place;
        }
        machine.take_map(renewed, epoch());
        self.counts.maps_corrected += 1;
        // Newer corrections may have come.
        self.may_be_moved = true;
        Ok(true)
    }

    /// Begins a map with the newest corrections, if they displace a cloud by more than `least_m`.
    fn begin(&mut self, machine: &LatticeMapper, least_m: f64) -> Result<bool, FreeSpaceError> {
        let Some(followed) = &self.corrections else {
            return Ok(false);
        };
        let is_due = self.may_be_moved && !followed.is_other_drive && !self.is_full;
        self.may_be_moved = false;
        let mut clouds = self.clouds.iter();
        if !is_due || !clouds.any(|cloud| self.is_moved(cloud, least_m)) {
            return Ok(false);
        }
        let corrections = followed.placed.clone();
        let mut renewed = LatticeMapper::new(machine.options.clone(), 0)?;
        if let Some(base) = &self.base
            && let Err(refusal) = renewed.load(base.clone(), 0)
        {
            log::error!("the map is not corrected: {refusal}");
            return Ok(false);
        }
        self.renewal = Some(Renewal {
            machine: renewed,
            corrections,
            places: Vec::with_capacity(self.clouds.len()),
        });
        Ok(true)
    }
}
