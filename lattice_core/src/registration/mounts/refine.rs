//! Gauss-Newton on the spread within flat cells, and the standard deviations of its result.

use std::collections::BTreeMap;

use super::jackknife;
use super::planes::{ByPose, Matrix7, Plane, Segments, Vector7, planes, planes_of_segments};
use super::{MIN_PLANES, MountCorrection, MountError, MountNumber, MountOptions, MountSamples};
use nalgebra::{Matrix6, UnitQuaternion};

/// Cell sizes, metres, and the most steps at each.
pub(super) const LEVELS: [(f64, usize); 3] = [(1.0, 8), (0.5, 10), (0.35, 12)];
/// Steps without a segment of the log, from the estimate with it.
const JACKKNIFE_STEPS: usize = 2;
/// Largest step of a rotation (rad), of the lever arm (m) and of the time (s).
const LARGEST_STEP: [f64; 3] = [0.05, 0.3, 0.02];
/// Step below which the iteration ends.
const LEAST_STEP: [f64; 3] = [2e-5, 2e-4, 2e-5];
/// Standard deviations about the stated mount, where the log has no evidence.
const PRIOR: [f64; 3] = [0.26, 1.0, 0.05];
/// Noise of the best lidars across a surface, metres.
const LEAST_NOISE_M: f64 = 0.004;

/// Result of the refinement.
pub(super) struct Refined {
    pub correction: MountCorrection,
    pub numbers: [MountNumber; 7],
    pub planes: usize,
    pub thickness_m: f64,
}

/// Median standard deviation across flat cells, metres.
pub(super) fn thickness_m(samples: &MountSamples, at: &MountCorrection) -> f64 {
    let (cell_m, _) = LEVELS[LEVELS.len() - 1];
    median_m(&planes(samples, at, cell_m))
}

fn median_m(planes: &[Plane]) -> f64 {
    let mut all: Vec<f64> = planes
        .iter()
        .map(|plane| plane.variance_m2.sqrt())
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

/// Refines a correction; numbers without evidence stay as stated.
pub(super) fn refine(
    samples: &MountSamples,
    start: &MountCorrection,
    options: &MountOptions,
) -> Result<Refined, MountError> {
    let mut is_free = [true; 7];
    is_free[6] = options.with_time;
    let mut correction = start.clone();
    for (cell_m, steps) in LEVELS {
        iterate(samples, &mut correction, cell_m, steps, &is_free)?;
    }
    let (cell_m, steps) = LEVELS[LEVELS.len() - 1];
    let mut all = sigmas(samples, &correction, cell_m, &is_free, options);
    let by_time = jackknife::sigmas(samples, &correction, |part, correction| {
        iterate(part, correction, cell_m, JACKKNIFE_STEPS, &is_free)
    });
    for ((sigma, by_time), prior) in all.iter_mut().zip(by_time).zip(PRIOR_SIGMAS) {
        *sigma = sigma.max(by_time).min(prior);
    }
    let limits = options.max_sigmas();
    let mut is_observable = is_free;
    for (i, sigma) in all.iter().enumerate() {
        is_observable[i] &= *sigma <= limits[kind(i)];
    }
    // The others with those without evidence as stated.
    if is_observable != is_free {
        let mut vector = correction.vector();
        for (i, value) in vector.iter_mut().enumerate() {
            if !is_observable[i] {
                *value = 0.0;
            }
        }
        correction = correction.of(&vector);
        iterate(samples, &mut correction, cell_m, steps, &is_observable)?;
    }
    let found = planes(samples, &correction, cell_m);
    let vector = correction.vector();
    let numbers = std::array::from_fn(|i| MountNumber {
        value: vector[i],
        sigma: all[i],
        is_observable: is_observable[i],
    });
    Ok(Refined {
        numbers,
        planes: found.len(),
        thickness_m: median_m(&found),
        correction,
    })
}

/// Kind of a number: rotation, lever arm or time.
pub(super) fn kind(number: usize) -> usize {
    number / 3
}

/// Weighted sums over flat cells.
struct Sums {
    normal: Matrix7,
    gradient: Vector7,
    /// Sums of the gradients' outer products by block.
    spread: Matrix7,
    /// Derivatives of the gradient by the errors of the poses of a segment.
    segments: BTreeMap<u16, ByPose>,
}

fn sums(planes: &[Plane], is_free: &[bool; 7]) -> Sums {
    let noise_m2 = LEAST_NOISE_M.powi(2) + median_m(planes).powi(2);
    let (mut normal, mut gradient) = (Matrix7::zeros(), Vector7::zeros());
    let mut blocks: BTreeMap<[i32; 3], Vector7> = BTreeMap::new();
    let mut segments: BTreeMap<u16, ByPose> = BTreeMap::new();
    for plane in planes {
        // Cells with a large spread hold moving things or more than one surface.
        let robust = 1.0 / (1.0 + plane.variance_m2 / noise_m2);
        let weight = plane.share * robust * robust / noise_m2;
        let mut jr = plane.gradient * weight;
        let mut jj = plane.normal * weight;
        for i in (0..7).filter(|i| !is_free[*i]) {
            jr[i] = 0.0;
            jj.column_mut(i).fill(0.0);
            jj.row_mut(i).fill(0.0);
        }
        normal += jj;
        gradient += jr;
        *blocks.entry(plane.block).or_insert_with(Vector7::zeros) += jr;
        for (segment, by_pose) in &plane.by_pose {
            let mut by_pose = by_pose * weight;
            for i in (0..7).filter(|i| !is_free[*i]) {
                by_pose.row_mut(i).fill(0.0);
            }
            *segments.entry(*segment).or_insert_with(ByPose::zeros) += by_pose;
        }
    }
    let count = blocks.len().max(9) as f64;
    let spread: Matrix7 = blocks.values().map(|g| g * g.transpose()).sum();
    Sums {
        normal,
        gradient,
        spread: spread * (count / (count - 8.0)),
        segments,
    }
}

/// Information of the prior.
fn prior() -> Matrix7 {
    Matrix7::from_diagonal(&Vector7::from_fn(|i, _| PRIOR[kind(i)].powi(-2)))
}

/// Standard deviations that allow for correlated errors of points within blocks (White's estimator), and of the poses
/// within segments of time.
pub(super) fn sigmas(
    samples: &MountSamples,
    at: &MountCorrection,
    cell_m: f64,
    is_free: &[bool; 7],
    options: &MountOptions,
) -> [f64; 7] {
    let segments = Segments::new(samples);
    let found = planes_of_segments(samples, at, cell_m, Some(&segments));
    let sums = sums(&found, is_free);
    let Some(inverse) = (sums.normal + prior()).try_inverse() else {
        return PRIOR_SIGMAS;
    };
    let (position, attitude) = (options.pose_sigma_m.powi(2), options.pose_sigma_rad.powi(2));
    let variance = [position, position, position, attitude, attitude, attitude];
    let variance = Matrix6::from_diagonal(&variance.into());
    let of_poses: Matrix7 = (sums.segments.values())
        .map(|by_pose| by_pose * variance * by_pose.transpose())
        .sum();
    let covariance = inverse * (sums.spread + of_poses + prior()) * inverse;
    std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt().min(PRIOR_SIGMAS[i]))
}

const PRIOR_SIGMAS: [f64; 7] = [
    PRIOR[0], PRIOR[0], PRIOR[0], PRIOR[1], PRIOR[1], PRIOR[1], PRIOR[2],
];

/// Steps of Gauss-Newton until they are small, at one cell size.
pub(super) fn iterate(
    samples: &MountSamples,
    correction: &mut MountCorrection,
    cell_m: f64,
    steps: usize,
    is_free: &[bool; 7],
) -> Result<(), MountError> {
    for _ in 0..steps {
        let found = planes(samples, correction, cell_m);
        if found.len() < MIN_PLANES {
            let planes = found.len();
            return Err(MountError::FewPlanes { planes });
        }
        let sums = sums(&found, is_free);
        let vector = correction.vector();
        let free = Vector7::from_fn(|i, _| f64::from(u8::from(is_free[i])));
        let pull = (prior() * vector).component_mul(&free);
        let Some(solver) = (sums.normal + prior()).cholesky() else {
            return Ok(());
        };
        let step = -solver.solve(&(sums.gradient + pull));
        let factor = (0..7)
            .map(|i| LARGEST_STEP[kind(i)] / step[i].abs().max(1e-12))
            .fold(1.0, f64::min);
        let step = step * factor;
        let mut next = vector + step;
        // The rotation is added from the left, in the base frame.
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        let turned = (turn * correction.rotation).scaled_axis();
        next.fixed_rows_mut::<3>(0).copy_from(&turned);
        for i in (0..7).filter(|i| !is_free[*i]) {
            next[i] = vector[i];
        }
        *correction = correction.of(&next);
        if (0..7).all(|i| step[i].abs() < LEAST_STEP[kind(i)]) {
            break;
        }
    }
    Ok(())
}
