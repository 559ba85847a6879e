//! State of the server: the followed map, the scans of the headset, the running job, the current pose.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lattice_core::registration::{SourceCloud, TrackUpdate};
use lattice_msgs::lattice::CalibrationResult;
use nalgebra::Isometry3;

use super::counts::ServerCounts;
use super::headset_scans::HeadsetScans;
use super::options::ServerOptions;
use super::output::CallId;
use crate::map_follower::MapFollower;

/// A search request that waits for the running job, with its caller.
#[derive(Default)]
pub(super) struct PendingRequest {
    pub caller: Option<CallId>,
    pub start: Option<Isometry3<f64>>,
}

/// Current pose of the headset and the result of its search.
pub(super) struct CurrentCalibration {
    pub map_from_headset: Isometry3<f64>,
    /// Result of the search that found it.
    pub result: CalibrationResult,
    /// Number of scans of the last confirming search, successful or not.
    pub looks: usize,
}

/// A running job.
pub(super) struct Running {
    pub job: u64,
    pub caller: Option<CallId>,
    pub canceled: Arc<AtomicBool>,
    /// True if its result is to be ignored.
    pub outdated: bool,
    pub begun_ns: i64,
    pub stamp_ns: i64,
    /// Scans of a search, or the single scan of tracking.
    pub headset_scans: Vec<Arc<SourceCloud>>,
    pub tracking: bool,
    /// Fit of the scan to the current pose, for a search started by a poor fit.
    pub doubted: Option<TrackUpdate>,
    /// True for a search that confirms the current pose with more scans.
    pub confirms: bool,
}

impl Running {
    /// Number of scans, and of their points.
    pub fn gazes_and_points(&self) -> (u32, u64) {
        let points = self
            .headset_scans
            .iter()
            .map(|scan| scan.cloud.len() as u64);
        (self.headset_scans.len() as u32, points.sum())
    }
}

/// Follows a map and a headset, and estimates the headset's pose.
pub struct SemanticIcpServer {
    pub(super) options: ServerOptions,
    pub(super) follower: MapFollower,
    pub(super) session: String,
    pub(super) headset_scans: HeadsetScans,
    /// Class names of the headset.
    pub(super) names: BTreeMap<u16, String>,
    pub(super) current: Option<CurrentCalibration>,
    /// Consecutive searches that did not confirm the current pose.
    pub(super) misses: u32,
    /// Time until which a poor fit of a scan starts no search.
    pub(super) doubt_again_ns: i64,
    pub(super) running: Option<Running>,
    pub(super) pending: Option<PendingRequest>,
    /// True if a cloud has arrived since the last search.
    pub(super) fresh_cloud: bool,
    /// Newest cloud for tracking the current pose, and its stamp.
    pub(super) look: Option<(Arc<SourceCloud>, i64)>,
    pub(super) next_job: u64,
    /// Learned label confusions are of another session, segmenter or map.
    pub(super) reset_label_confusion: bool,
    /// Map state last passed to the search: epoch, sequence, and time.
    pub(super) prepared: Option<(u64, Option<u64>, i64)>,
    pub(super) last: CalibrationResult,
    pub(super) published_ns: i64,
    pub(super) counts: ServerCounts,
}

impl SemanticIcpServer {
    /// Initial state.
    pub fn new(options: ServerOptions) -> Self {
        Self {
            follower: MapFollower::new(options.max_map_voxels),
            session: String::new(),
            headset_scans: HeadsetScans::new(
                options.max_headset_scans,
                options.headset_scan_period_ns,
            ),
            names: BTreeMap::new(),
            current: None,
            misses: 0,
            doubt_again_ns: 0,
            running: None,
            pending: None,
            fresh_cloud: false,
            look: None,
            next_job: 0,
            reset_label_confusion: false,
            prepared: None,
            last: CalibrationResult::default(),
            published_ns: 0,
            counts: ServerCounts::default(),
            options,
        }
    }

    /// Changes the options; the search has its own.
    pub fn set_options(&mut self, options: ServerOptions) {
        self.follower.set_max_voxels(options.max_map_voxels);
        let period_ns = options.headset_scan_period_ns;
        self.headset_scans
            .set_bounds(options.max_headset_scans, period_ns);
        self.options = options;
    }

    /// Counters of clouds, requests and searches, by reason.
    pub fn counts(&self) -> &ServerCounts {
        &self.counts
    }

    /// `map_from_headset_origin`, if known.
    pub fn map_from_headset(&self) -> Option<Isometry3<f64>> {
        self.current
            .as_ref()
            .map(|current| current.map_from_headset)
    }

    /// The newest result.
    pub fn last_result(&self) -> &CalibrationResult {
        &self.last
    }

    /// Name of a class of the headset, if known.
    pub fn class_name(&self, class: u16) -> Option<&str> {
        self.names.get(&class).map(String::as_str)
    }

    /// Number of voxels of the followed map; 0 before its first keyframe.
    pub fn map_voxels(&self) -> usize {
        self.follower.map().map_or(0, |map| map.voxels().len())
    }

    pub(super) fn has_map(&self) -> bool {
        self.map_voxels() > 0
    }
}
