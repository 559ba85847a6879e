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
mod mount_number;
mod planes;
mod quick;
mod refine;
mod samples;
#[cfg(test)]
mod tests;
mod time_scan;

use nalgebra::Vector3;

pub use correction::MountCorrection;
pub use time_scan::MAX_DELAY_S;

pub use mount_number::{MountNumber, MountOptions};
use refine::Refined;
pub use samples::{BasePose, MountError, MountSamples};
use samples::{MIN_PLANES, MIN_POINTS};
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
    estimate_about(offset_of(samples, options), samples, options)
}

/// Checks the stated mount: `None` if no observable correction near it is certain and above `least` (rad, m, s), else
/// the estimate. Costs a fraction of [`estimate_mount`] where the mount fits.
///
/// # Errors
/// As [`estimate_mount`].
pub fn check_mount(
    samples: &MountSamples,
    options: &MountOptions,
    least: [f64; 3],
) -> Result<Option<MountEstimate>, MountError> {
    check_motion(&samples.poses)?;
    let offset = offset_of(samples, options);
    let is_near = match offset {
        Offset::Nothing => true,
        Offset::Near(offset_s) => offset_s.abs() < LEAST_OFFSET_S,
        Offset::Far(_) => false,
    };
    // Too few flat cells may be the fault of the stated mount.
    if is_near && quick::fits_as_stated(&centered(samples), options, least).unwrap_or(false) {
        return Ok(None);
    }
    estimate_about(offset, samples, options).map(Some)
}

fn offset_of(samples: &MountSamples, options: &MountOptions) -> Offset {
    match options.with_time {
        true => time_scan::search(samples),
        false => Offset::Nothing,
    }
}

/// Estimate where the times of points have an offset.
fn estimate_about(
    offset: Offset,
    samples: &MountSamples,
    options: &MountOptions,
) -> Result<MountEstimate, MountError> {
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
    let is_certain = |number: &MountNumber| {
        number.is_observable && number.value.abs() > quick::CERTAIN * number.sigma
    };
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
