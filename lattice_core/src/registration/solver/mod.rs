//! Levenberg-Marquardt on SE(3) with alternating correspondence searches.
//!
//! Reading order: this file has the loop, [`correspondences`] finds the correspondences of a pose,
//! [`correspondence_weights`] weights them, [`correspondence`] computes a residual, [`robust_kernel`] limits its
//! cost, [`normal_equations`] accumulates the linear system.

mod correspondence;
mod correspondence_weights;
mod correspondences;
mod method_labels;
mod normal_equations;
mod robust_kernel;

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};

use correspondences::Correspondences;
use normal_equations::NormalEquations;

use super::{Method, PreparedCloud, RegisterOptions, SemanticVariant};
use crate::pose::se3;

/// Initial damping relative to the mean of the Hessian's diagonal.
const LAMBDA: f64 = 1e-6;
/// Factor on the damping per accepted or rejected step.
const LAMBDA_FACTOR: f64 = 10.0;
/// Minimum damping, so that degenerate directions do not move.
const MIN_LAMBDA: f64 = 1e-12;
/// Distance of the source centroid from its origin up to which rotations are about the origin, metres.
///
/// Beyond it, rotations are about the centroid, so that lever arms, whose squares enter the damping, do not depend on
/// the position of the cloud. At this distance the first damping shortens a step along an axis by 0.3 % (1e-6 x 100^2
/// / 3).
const FAR_M: f64 = 100.0;
/// Maximum number of dampings tried per step.
const MAX_DAMPINGS: usize = 12;
/// Fraction of the tolerances at which the steps between two searches converge.
const INNER_SHARE: f64 = 1e-3;

/// Result of a registration.
///
/// `cost`, `inliers`, `rmse_m` and `hessian` belong to the last correspondences, before the last step.
#[derive(Clone, PartialEq, Debug)]
pub struct Registration {
    /// Transform of source points to the target frame.
    pub target_from_source: Isometry3<f64>,
    /// True if the last step was below the tolerances.
    pub converged: bool,
    /// Number of correspondence searches.
    pub iterations: usize,
    /// Value of the minimized cost.
    pub cost: f64,
    /// Number of source points with a correspondence.
    pub inliers: usize,
    /// Weighted RMS distance, metres.
    pub rmse_m: f64,
    /// Half the Hessian of the cost, J^T W J, by a translation (m) and a rotation (rad) along the axes of the source.
    pub hessian: Matrix6<f64>,
}

/// Registers `source` to `target` from an initial guess.
///
/// The clouds may be far from their origins. The result is bit-identical on any number of threads. Without
/// correspondences, or from a guess that is not finite, the guess is returned, not converged.
///
/// ```
/// use lattice_core::nalgebra::{Isometry3, Point3};
/// use lattice_core::registration::{
///     PrepareOptions, PreparedCloud, RegisterOptions, RegistrationError, SemanticCloud, register,
/// };
///
/// // Three planes at right angles, and the same 5 cm off.
/// let grid = |i: u32| (f64::from(i % 20) * 0.1, f64::from(i / 20) * 0.1);
/// let planes = (0..400).map(grid).flat_map(|(u, v)| {
///     [Point3::new(u, v, 0.0), Point3::new(u, 0.0, v), Point3::new(0.0, u, v)]
/// });
/// let target = SemanticCloud::unlabelled(planes.collect());
/// let target_from_source = Isometry3::translation(0.05, 0.05, 0.05);
/// let moved = target.points_m.iter().map(|p| target_from_source.inverse() * p);
/// let source = SemanticCloud::unlabelled(moved.collect());
///
/// let options = PrepareOptions::default();
/// let (source, target) = (PreparedCloud::new(source, &options)?, PreparedCloud::new(target, &options)?);
/// let found = register(&source, &target, &Isometry3::identity(), &RegisterOptions::gicp(0.5));
/// let error = target_from_source.inverse() * found.target_from_source;
/// assert!(found.converged && error.translation.vector.norm() < 1e-3);
/// # Ok::<(), RegistrationError>(())
/// ```
pub fn register(
    source: &PreparedCloud,
    target: &PreparedCloud,
    target_from_source_start: &Isometry3<f64>,
    options: &RegisterOptions,
) -> Registration {
    let center = center_of(source);
    let mut state = State {
        pose: *target_from_source_start,
        center,
        lambda: LAMBDA,
        sums: NormalEquations::default(),
    };
    let mut registration = Registration {
        target_from_source: state.pose,
        converged: false,
        iterations: 0,
        cost: 0.0,
        inliers: 0,
        rmse_m: 0.0,
        hessian: Matrix6::zeros(),
    };
    let finite = |pose: &Isometry3<f64>| pose.to_homogeneous().iter().all(|v| v.is_finite());
    if !finite(&state.pose) {
        return registration;
    }
    let mut pairs = Correspondences::new(source, target, options, center);
    let mut scale = match options.method {
        Method::Semantic(SemanticVariant::Em) if options.anneal < 1.0 => pairs.widest_scale(),
        _ => 1.0,
    };
    while registration.iterations < options.max_iterations {
        registration.iterations += 1;
        state.sums = pairs.find(&state.pose, scale);
        if state.sums.pairs == 0 || state.sums.weight <= 0.0 {
            break;
        }
        let before = state.pose;
        let moved = state.minimize(&pairs, options);
        let step = se3::log(&about(&-center.coords, &(before.inverse() * state.pose)));
        if scale <= 1.0 {
            registration.converged = moved && is_small(&step, options, 1.0);
            if registration.converged || !moved {
                break;
            }
        }
        scale = (scale * options.anneal.max(0.0)).max(1.0);
    }
    let sums = &state.sums;
    registration.hessian = sums.system(&state.pose).0;
    registration.target_from_source = state.pose;
    registration.cost = sums.cost;
    registration.inliers = sums.inliers;
    if sums.weight > 0.0 {
        registration.rmse_m = (sums.squared_m2 / sums.weight).sqrt();
    }
    registration
}

struct State {
    pose: Isometry3<f64>,
    /// Centre of the rotations in the source, metres.
    center: Point3<f64>,
    lambda: f64,
    sums: NormalEquations,
}

impl State {
    /// Minimizes the cost of fixed correspondences; false if no first step lowers it.
    fn minimize(&mut self, pairs: &Correspondences, options: &RegisterOptions) -> bool {
        for inner in 0..options.inner_iterations.max(1) {
            if inner > 0 {
                self.sums = pairs.linearize(&self.pose);
            }
            let Some(step) = self.step(pairs, options) else {
                return inner > 0;
            };
            if is_small(&step, options, INNER_SHARE) {
                break;
            }
        }
        true
    }

    /// Finds a step that lowers the cost, or a zero step if one below the tolerances does not; `None` if no damping
    /// gives one.
    fn step(&mut self, pairs: &Correspondences, options: &RegisterOptions) -> Option<Vector6<f64>> {
        let (h, b) = self.sums.system(&self.pose);
        let size = h.trace() / 6.0;
        for attempt in 0..MAX_DAMPINGS {
            let damped = h + Matrix6::from_diagonal_element(self.lambda * size);
            let step = damped.cholesky().map(|c| -c.solve(&b));
            let step = step.filter(|step| step.iter().all(|v| v.is_finite()));
            if let Some(step) = step {
                let pose = self.pose * about(&self.center.coords, &se3::exp(&step));
                if pairs.cost(&pose) < self.sums.cost {
                    self.pose = renormalized(pose);
                    self.lambda = (self.lambda / LAMBDA_FACTOR).max(MIN_LAMBDA);
                    return Some(step);
                }
                if attempt == 0 && is_small(&step, options, 1.0) {
                    return Some(Vector6::zeros());
                }
            }
            self.lambda *= LAMBDA_FACTOR;
        }
        None
    }
}

/// Centroid of a cloud in whole metres, or its origin if that is near.
fn center_of(cloud: &PreparedCloud) -> Point3<f64> {
    let points_m = cloud.points_m();
    let sum: Vector3<f64> = points_m.iter().map(|p| p.coords).sum();
    let mean_m = sum / points_m.len().max(1) as f64;
    match mean_m.norm() > FAR_M {
        true => Point3::from(mean_m.map(f64::round)),
        false => Point3::origin(),
    }
}

/// Expresses a motion about the origin as one about another point.
fn about(center: &Vector3<f64>, motion: &Isometry3<f64>) -> Isometry3<f64> {
    if *center == Vector3::zeros() {
        return *motion;
    }
    let mut motion = *motion;
    motion.translation.vector += center - motion.rotation * center;
    motion
}

/// Tests whether a step is below a fraction of the tolerances.
fn is_small(step: &Vector6<f64>, options: &RegisterOptions, share: f64) -> bool {
    step.fixed_rows::<3>(0).norm() <= share * options.translation_tolerance_m
        && step.fixed_rows::<3>(3).norm() <= share * options.rotation_tolerance_rad
}

fn renormalized(mut pose: Isometry3<f64>) -> Isometry3<f64> {
    pose.rotation.renormalize();
    pose
}

#[cfg(test)]
mod tests;
