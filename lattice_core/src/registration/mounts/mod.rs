//! Mount of a sensor, found in a log with poses: the correction with which surfaces seen from several poses are thin.
//!
//! A coarse search lowers the number of occupied voxels (the measure of Ryde & Brünig 2011) on lattices from 2 m to
//! 0.25 m. Gauss-Newton then lowers the spread of points about the planes of cells, whose offset and tilt are
//! eliminated, so that only motion between poses is evidence. Each of the seven numbers has a standard deviation and a
//! verdict, in [`MountNumber`]. The standard deviation is the larger one of two: of points by blocks of space (White's
//! estimator) with errors of the poses by segments of time, and of the jackknife over segments of the log. A motion
//! that is not above these errors excites nothing.

mod coarse;
mod correction;
mod jackknife;
mod planes;
mod refine;
#[cfg(test)]
mod tests;
mod time_scan;

use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

pub use correction::MountCorrection;
pub use time_scan::MAX_DELAY_S;

use crate::pose::StampedPose;
use refine::Refined;
use time_scan::Offset;

/// Names of the seven numbers of a mount, in the order of [`MountEstimate::numbers`].
pub const MOUNT_NUMBERS: [&str; 7] = ["roll", "pitch", "yaw", "x", "y", "z", "time"];

/// Cell size at which occupied voxels before and after are counted, metres.
const COUNT_CELL_M: f64 = 0.25;
/// Rotation (rad) and shift (m) above which a correction lowers the number of occupied voxels.
const LARGE_RAD: f64 = 0.02;
const LARGE_M: f64 = 0.15;
/// Smallest offset of times that the refinement does not reach from none, seconds.
const LEAST_OFFSET_S: f64 = 0.03;
/// Minimum number of points.
const MIN_POINTS: usize = 2000;
/// Minimum number of planar cells.
const MIN_PLANES: usize = 30;

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
const HALF_SPAN_NS: i64 = 10_000_000;

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
    /// Poses of the base.
    pub poses: Vec<BasePose>,
    /// Place of the pose in `poses`, and the point in the base frame by the stated mount, metres.
    pub points: Vec<(u32, Vector3<f64>)>,
    /// Position of the sensor in the base frame by the stated mount, metres.
    pub sensor_m: Vector3<f64>,
    /// Poses of the base by time, in the time of `poses`; without them the time offset is at most that of a driver.
    pub way: Vec<StampedPose>,
}

/// Options of [`estimate_mount`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountOptions {
    /// Largest standard deviation of an excited rotation, radians.
    pub max_sigma_rad: f64,
    /// Largest standard deviation of an excited coordinate of the lever arm, metres.
    pub max_sigma_m: f64,
    /// Largest standard deviation of an excited time offset, seconds.
    pub max_sigma_s: f64,
    /// True to estimate the time offset; else it is 0.
    pub with_time: bool,
    /// Standard deviation of the positions of a segment of the log, metres.
    pub pose_sigma_m: f64,
    /// Standard deviation of the attitudes of a segment of the log, radians.
    pub pose_sigma_rad: f64,
}

impl Default for MountOptions {
    fn default() -> MountOptions {
        MountOptions {
            max_sigma_rad: 0.3_f64.to_radians(),
            max_sigma_m: 0.05,
            max_sigma_s: 0.005,
            with_time: true,
            pose_sigma_m: 0.02,
            pose_sigma_rad: 0.05_f64.to_radians(),
        }
    }
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

/// One number of a mount: rad, m or s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountNumber {
    /// Correction to the stated value; 0 unless the motion excited it.
    pub value: f64,
    /// Standard deviation of the correction, limited by the range of the search.
    pub sigma: f64,
    /// True if the motion excited the number, so that the log determines it.
    pub is_observable: bool,
}

/// Fit of points by a mount.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MountFit {
    /// Occupied voxels of 0.25 m.
    pub voxels: usize,
    /// Median standard deviation of the points of a flat cell across its plane, metres.
    pub thickness_m: f64,
}

/// Result of [`estimate_mount`].
#[derive(Clone, Debug, PartialEq)]
pub struct MountEstimate {
    /// Corrections about and along the axes of the base, and of the time; see [`MOUNT_NUMBERS`].
    pub numbers: [MountNumber; 7],
    /// The correction as one.
    pub correction: MountCorrection,
    /// Fit of the stated mount.
    pub before: MountFit,
    /// Fit of the estimate.
    pub after: MountFit,
    /// Points used.
    pub points: usize,
    /// Flat cells used.
    pub planes: usize,
}

impl MountEstimate {
    /// Angle and axis in the base frame of the rotation of the correction, rad.
    pub fn turn(&self) -> (f64, Vector3<f64>) {
        let rotation = self.correction.rotation;
        let axis = rotation.axis().map_or(Vector3::z(), |axis| *axis);
        (rotation.angle(), axis)
    }
}

/// Estimates the correction of the mount of a sensor.
///
/// The stated mount is within 15 degrees about each axis and 1 m along each, the stamps within 40 s of the poses. Points
/// and poses may be in any order; the result does not depend on the number of threads.
///
/// # Errors
/// If points, planes or motion are too few, or if the best mount fits worse than the stated one.
pub fn estimate_mount(
    samples: &MountSamples,
    options: &MountOptions,
) -> Result<MountEstimate, MountError> {
    check_motion(&samples.poses)?;
    let offset = match options.with_time {
        true => time_scan::search(samples),
        false => Offset::Nothing,
    };
    match offset {
        Offset::Nothing => estimate_from(samples, samples, options),
        Offset::Far(offset_s) => {
            let found = estimate_at(samples, offset_s, options);
            found.map_err(|_| MountError::Stamps { offset_s })
        }
        Offset::Near(offset_s) => {
            let stated = estimate_from(samples, samples, options);
            if offset_s.abs() < LEAST_OFFSET_S {
                return stated;
            }
            let moved = estimate_at(samples, offset_s, options);
            match (&stated, &moved) {
                (Ok(a), Ok(b)) if a.after.thickness_m <= b.after.thickness_m => stated,
                (Ok(_), Err(_)) => stated,
                _ => moved,
            }
        }
    }
}

/// Estimate about an offset of the times of points.
fn estimate_at(
    samples: &MountSamples,
    offset_s: f64,
    options: &MountOptions,
) -> Result<MountEstimate, MountError> {
    let [stated, moved] = time_scan::moved(samples, offset_s);
    let mut found = estimate_from(&stated, &moved, options)?;
    found.correction.time_s += offset_s;
    let [.., time] = &mut found.numbers;
    if !time.is_observable {
        // Known from the scan alone.
        time.sigma = time.sigma.min(time_scan::SIGMA_S);
        time.is_observable = true;
    }
    time.value += offset_s;
    Ok(found)
}

/// Estimate from samples with the stated times, and with those to begin with.
fn estimate_from(
    stated: &MountSamples,
    samples: &MountSamples,
    options: &MountOptions,
) -> Result<MountEstimate, MountError> {
    let as_stated = &centered(stated);
    let samples = &centered(samples);
    if samples.points.len() < MIN_POINTS {
        let points = samples.points.len();
        return Err(MountError::FewPoints { points });
    }
    let stated = MountCorrection::identity(samples.sensor_m);
    let start = coarse::search(samples, &stated);
    let Refined {
        correction,
        numbers,
        planes,
        thickness_m,
    } = refine::refine(samples, &start, options)?;
    let before = MountFit {
        voxels: coarse::occupied(as_stated, &stated, COUNT_CELL_M),
        thickness_m: refine::thickness_m(as_stated, &stated),
    };
    let after = MountFit {
        voxels: coarse::occupied(samples, &correction, COUNT_CELL_M),
        thickness_m,
    };
    let is_outside = |number: &MountNumber, range: f64| number.value.abs() > 1.2 * range;
    let outside = numbers
        .iter()
        .take(3)
        .any(|n| is_outside(n, coarse::RANGE_RAD))
        || numbers
            .iter()
            .skip(3)
            .take(3)
            .any(|n| is_outside(n, coarse::RANGE_M));
    // A correction of this size lowers the number of voxels by percents where it is right.
    let is_large = correction.rotation.angle() > LARGE_RAD || correction.shift_m.norm() > LARGE_M;
    let limit = if is_large { 0.995 } else { 1.02 };
    // One that is certain makes surfaces thinner where it is right.
    let is_certain =
        |number: &MountNumber| number.is_observable && number.value.abs() > 3.0 * number.sigma;
    let is_thicker = after.thickness_m > before.thickness_m && numbers.iter().any(is_certain);
    if outside || is_thicker || after.voxels as f64 > limit * before.voxels as f64 {
        return Err(MountError::NoFit {
            range_deg: coarse::RANGE_RAD.to_degrees(),
            range_m: coarse::RANGE_M,
            before: before.voxels,
            after: after.voxels,
        });
    }
    Ok(MountEstimate {
        numbers,
        correction,
        before,
        after,
        points: samples.points.len(),
        planes,
    })
}

/// Samples about the mean of their positions, with finite points and valid poses alone.
fn centered(samples: &MountSamples) -> MountSamples {
    let count = samples.poses.len().max(1) as f64;
    let sum: Vector3<f64> = (samples.poses.iter())
        .map(|pose| pose.map_from_base.translation.vector)
        .sum();
    let middle_m = sum / count;
    let poses = samples.poses.iter().map(|pose| {
        let mut pose = *pose;
        pose.map_from_base.translation.vector -= middle_m;
        pose
    });
    let is_valid = |(place, point): &&(u32, Vector3<f64>)| {
        (*place as usize) < samples.poses.len() && point.iter().all(|v| v.is_finite())
    };
    MountSamples {
        poses: poses.collect(),
        points: samples.points.iter().filter(is_valid).copied().collect(),
        sensor_m: samples.sensor_m,
        way: Vec::new(),
    }
}

/// Fails for poses that stay at one place.
fn check_motion(poses: &[BasePose]) -> Result<(), MountError> {
    let Some(first) = poses.first() else {
        return Err(MountError::FewPoints { points: 0 });
    };
    let (mut least, mut most) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    let mut turned_rad: f64 = 0.0;
    for pose in poses {
        let position = pose.map_from_base.translation.vector;
        (least, most) = (least.inf(&position), most.sup(&position));
        let turn = first
            .map_from_base
            .rotation
            .angle_to(&pose.map_from_base.rotation);
        turned_rad = turned_rad.max(turn);
    }
    let moved_m = (most - least).norm();
    if moved_m < 0.5 && turned_rad < 5_f64.to_radians() {
        let turned_deg = turned_rad.to_degrees();
        return Err(MountError::NoMotion {
            moved_m,
            turned_deg,
        });
    }
    Ok(())
}
