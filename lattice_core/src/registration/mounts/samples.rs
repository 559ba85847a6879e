//! Scans and poses of a mount.

use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

use crate::pose::StampedPose;

/// Minimum number of points.
pub(super) const MIN_POINTS: usize = 2000;

/// Minimum number of planar cells.
pub(super) const MIN_PLANES: usize = 30;

/// Pose of the base at the time of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasePose {
    /// Time, seconds from any origin.
    pub stamp_s: f64,
    /// Pose of the base in the map, metres.
    pub map_from_base: Isometry3<f64>,
    /// Velocity of the origin of the base in the map frame, m/s.
    pub velocity_m_per_s: Vector3<f64>,
    /// Turning rate in the map frame, rad/s.
    pub rate_rad_per_s: Vector3<f64>,
}

/// Time on both sides of a pose within which its motion is measured, nanoseconds.
pub(super) const HALF_SPAN_NS: i64 = 10_000_000;

impl BasePose {
    /// Pose and motion at a time in nanoseconds, from `map_from_base` at any time; `None` where that has no pose within
    /// 10 ms before or after it.
    pub fn at(
        at_ns: i64,
        map_from_base: impl Fn(i64) -> Option<Isometry3<f64>>,
    ) -> Option<BasePose> {
        let here = map_from_base(at_ns)?;
        let before = map_from_base(at_ns.checked_sub(HALF_SPAN_NS)?)?;
        let after = map_from_base(at_ns.checked_add(HALF_SPAN_NS)?)?;
        let span_s = 2e-9 * HALF_SPAN_NS as f64;
        let turn = after.rotation * before.rotation.inverse();
        let way = after.translation.vector - before.translation.vector;
        Some(BasePose {
            stamp_s: at_ns as f64 * 1e-9,
            map_from_base: here,
            velocity_m_per_s: way / span_s,
            rate_rad_per_s: turn.scaled_axis() / span_s,
        })
    }
}

/// Points of one sensor, each with the pose of the base at its time.
#[derive(Clone, Debug, Default)]
pub struct MountSamples {
    /// Poses of the base in the map, one per time of points.
    pub poses: Vec<BasePose>,
    /// Index of the pose in `poses`, and the point in the base frame by the stated mount, metres.
    pub points: Vec<(u32, Vector3<f64>)>,
    /// Position of the sensor in the base frame by the stated mount, metres.
    pub sensor_m: Vector3<f64>,
    /// Poses of the base by time, in the time of `poses`; without them the time offset is at most that of a driver.
    pub way: Vec<StampedPose>,
}

/// Cause for which no mount is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum MountError {
    /// Too few points.
    #[error("{points} points with poses; at least {MIN_POINTS} are needed")]
    FewPoints {
        /// Number of points.
        points: usize,
    },
    /// Too few planar cells.
    #[error(
        "{planes} cells with a flat surface; at least {MIN_PLANES} are needed: drive past walls and over ground"
    )]
    FewPlanes {
        /// Number of planar cells.
        planes: usize,
    },
    /// Poses that do not move.
    #[error(
        "the poses move by {moved_m:.2} m and turn by {turned_deg:.1} degrees; at least 0.5 m or 5 degrees are needed"
    )]
    NoMotion {
        /// Diagonal of the box of positions, metres.
        moved_m: f64,
        /// Largest turn from the first pose, degrees.
        turned_deg: f64,
    },
    /// Times of the points that contradict the poses, where surfaces are too few for an estimate.
    #[error("the points fit the poses with {offset_s:+.2} s added to their times")]
    Stamps {
        /// Time to add to those of the points, seconds.
        offset_s: f64,
    },
    /// An optimum that is not better than the stated mount, or outside of the range of the search.
    #[error(
        "no mount within {range_deg:.0} degrees and {range_m} m of the stated one fits: {before} occupied voxels with the stated mount, {after} at the best"
    )]
    NoFit {
        /// Range of the search about each axis, degrees.
        range_deg: f64,
        /// Range of the search along each axis, metres.
        range_m: f64,
        /// Occupied voxels with the stated mount.
        before: usize,
        /// Occupied voxels with the estimate.
        after: usize,
    },
}
