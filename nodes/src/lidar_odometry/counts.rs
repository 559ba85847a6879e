//! Counters and report of the odometry.

use serde::{Deserialize, Serialize};

use crate::enu_transformer::{CloudNote, Refusal};

/// Counters of an odometry. Every cloud ends in exactly one of those behind `clouds_in`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OdometryCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Poses that the map holds in all directions.
    pub scans_ok: u64,
    /// Poses that are predicted along weak directions.
    pub scans_weak: u64,
    /// Poses that are predicted: the scan has too few points.
    pub lost_few_points: u64,
    /// Poses that are predicted: the map does not explain the scan.
    pub lost_no_overlap: u64,
    /// Poses that are predicted: the surfaces in view do not show the motion.
    pub lost_unobservable: u64,
    /// Poses without a verdict: the machine has not left the place where the map began.
    pub lost_one_place: u64,
    /// Dropped: the bytes are not what the header says, or no usable per-point time.
    pub clouds_malformed: u64,
    /// Dropped: no transform from the frame of the machine to that of the cloud.
    pub clouds_no_mount: u64,
    /// Dropped: older than the cloud before.
    pub clouds_out_of_order: u64,
    /// Samples of a gyroscope that are not used.
    pub imu_refused: u64,
    /// Poses of wheels that are not used.
    pub wheels_refused: u64,
    /// Scans deskewed and predicted by a gyroscope.
    pub scans_with_imu: u64,
    /// Scans predicted by wheels.
    pub scans_with_wheels: u64,
    /// Submaps begun.
    pub submaps: u64,
    /// Length of the path of poses that are not lost, m.
    pub path_m: f64,
}

impl OdometryCounts {
    /// Clouds without a pose.
    pub fn clouds_refused(&self) -> u64 {
        self.clouds_malformed + self.clouds_no_mount + self.clouds_out_of_order
    }

    /// Poses that are predictions, for whichever reason.
    pub fn scans_lost(&self) -> u64 {
        self.lost_few_points + self.lost_no_overlap + self.lost_unobservable + self.lost_one_place
    }
}

/// The end of a `lidar_odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OdometryReport {
    /// Everything counted by the state machine.
    pub counts: OdometryCounts,
    /// Loops that closed.
    #[serde(default)]
    pub loops_closed: u64,
    /// Loops whose registration was not certain, or that the others contradict.
    #[serde(default)]
    pub loops_refused: u64,
    /// Segments that found the queue of the thread of loops full: no loop is sought for them.
    #[serde(default)]
    pub segments_queue_full: u64,
    /// Clouds that found the inbox, or the queue before it, full.
    pub clouds_inbox_full: u64,
    /// Samples of imu and wheels that found the inbox full.
    pub motion_inbox_full: u64,
    /// Clouds that were sent and did not come.
    pub clouds_lost_on_network: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Messages refused, by topic and reason, with value and remedy.
    pub refusals: Vec<Refusal>,
    /// Notes on clouds read otherwise than declared, and on the source of the times of their points.
    pub notes: Vec<CloudNote>,
}
