//! Covariance of a pose with correlated errors and degenerate directions.

use std::collections::BTreeMap;

use nalgebra::{
    Isometry3, Matrix2, Matrix2x6, Matrix3, Matrix3x6, Matrix6, Matrix6x3, Point3, Vector3, Vector6,
};

use super::super::PreparedCloud;
use super::super::likelihood::region_of;
use super::calibration::{DirectionKind, WeakDirection};
use crate::pose::se3;

/// Residual at which the robust kernel halves the weight, in standard deviations.
pub(super) const KERNEL: f64 = 3.0;
/// Largest accepted squared Mahalanobis tilt; exceeded with probability 1e-4.
const MAX_TILT_SQUARED: f64 = 18.4;
/// Minimum standard deviation of points across surfaces, metres.
const MIN_POINT_M: f64 = 0.005;
/// Error of a surface whose normals in the two clouds are orthogonal, in spacings of the target.
const BENT: f64 = 0.8;
/// Ratio of the variance of the mean normal along one direction to the squared sine of the angle between the normals.
///
/// The difference has twice the variance of each normal, the mean half of it, and two directions share both.
const MEAN_NORMAL_VARIANCE: f64 = 0.125;
/// Minimum fraction of the information of a direction that remains after the correction for errors of the normals.
const MIN_REMAINING: f64 = 1e-3;
/// Information below which a direction has none, relative to the best constrained one.
const MIN_RELATIVE_INFORMATION: f64 = 1e-9;

/// Covariance of a pose of a source surface with region-wise correlated errors.
///
/// Errors within a region are correlated: a mesh is bent, a depth camera is biased. The inverse Hessian H^-1 ignores
/// this and is far too small (Bonnabel et al., arXiv 1410.7632). The covariance is therefore H^-1 (sum over regions
/// of the covariance of their gradients) H^-1. The gradient of a region varies with its residuals, with the errors of
/// the source, and with the curvature of the surfaces. Residuals count across surfaces only, since a plane does not
/// constrain motions along itself. H is corrected for the errors of the normals, as in an errors-in-variables
/// regression.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PoseCovariance {
    /// Covariance of a right perturbation (rho, phi), in the source frame.
    pub at_source: Matrix6<f64>,
}

/// Error model of a source and its target.
pub(super) struct ErrorModel {
    /// Side of the regions within which errors are correlated, metres.
    pub region_m: f64,
    /// Side of additional smaller regions, for a source that is hardly larger than a region, metres.
    pub within_m: Option<f64>,
    /// Standard deviation of the position of a region along each axis, metres.
    pub sigma_m: f64,
    /// Standard deviation of points across surfaces, metres.
    pub point_m: f64,
    /// Spacing of the target's points, metres.
    pub spacing_m: f64,
    /// Standard deviation of the scale of the source.
    pub scale_sigma: f64,
    /// Centre of the scaling in the source frame.
    pub center: Point3<f64>,
    /// Maximum distance of correspondences, metres.
    pub gate_m: f64,
}

/// Gradient of a region and its derivatives by the errors of the region.
#[derive(Clone, Copy, Default)]
struct RegionGradient {
    residual: Vector6<f64>,
    motion: Matrix6x3<f64>,
    bend: Matrix6x3<f64>,
}

impl PoseCovariance {
    /// Computes the covariance at a pose; `None` if the points do not constrain it.
    pub fn at(
        source: &PreparedCloud,
        target: &PreparedCloud,
        target_from_source: &Isometry3<f64>,
        model: &ErrorModel,
    ) -> Option<PoseCovariance> {
        let mut information = Information::default();
        let mut scaling = Vector6::zeros();
        let mut gradients: BTreeMap<[i64; 3], RegionGradient> = BTreeMap::new();
        let mut within: BTreeMap<[i64; 3], Matrix6x3<f64>> = BTreeMap::new();
        for (i, point) in source.points_m().iter().enumerate() {
            let place = target_from_source * point;
            let near = target.nearest(&place, model.gate_m);
            let near = near
                .and_then(|(j, _)| target.points_m().get(j).zip(target.normals().get(j)))
                .zip(source.normals().get(i));
            let Some(((partner, theirs), ours)) = near else {
                continue;
            };
            let ours = target_from_source * ours;
            let Some(across) = mean_normal(&ours, theirs) else {
                continue;
            };
            let sine_squared = ours.cross(theirs).norm_squared().min(1.0);
            let residual_m = across.dot(&(partner - place));
            let sigmas = residual_m / model.point_m.max(MIN_POINT_M);
            let weight = (1.0 - sine_squared) / (1.0 + (sigmas / KERNEL).powi(2));
            let lever = lever(target_from_source, point, &across);
            information.add(weight, &lever, sine_squared, point);
            scaling += lever * weight * across.dot(&(target_from_source * (point - model.center)));
            let gradient = gradients
                .entry(region_of(point, model.region_m))
                .or_default();
            gradient.residual += lever * weight * residual_m;
            let motion = lever * weight * across.transpose();
            gradient.motion += motion;
            gradient.bend += motion * (BENT * model.spacing_m * sine_squared.sqrt());
            if let Some(side_m) = model.within_m {
                *within.entry(region_of(point, side_m)).or_default() += motion;
            }
        }
        let mut scatter = model.scale_sigma.powi(2) * scaling * scaling.transpose();
        for gradient in gradients.values() {
            scatter += gradient.residual * gradient.residual.transpose();
            scatter += gradient.bend * gradient.bend.transpose();
        }
        for motion in gradients
            .values()
            .map(|gradient| &gradient.motion)
            .chain(within.values())
        {
            scatter += model.sigma_m.powi(2) * motion * motion.transpose();
        }
        let inverse = information.inverse()?;
        let at_source = inverse * scatter * inverse;
        let finite = at_source.iter().all(|c| c.is_finite());
        (finite && !gradients.is_empty()).then_some(PoseCovariance { at_source })
    }

    /// Updates the pose and its covariance with a tilt of zero, measured with `sigma_rad`.
    ///
    /// A Kalman update. `None` if the tilt exceeds both uncertainties: then one of the frames is not gravity-aligned.
    pub fn upright(
        &self,
        pose: &Isometry3<f64>,
        sigma_rad: f64,
    ) -> Option<(Isometry3<f64>, PoseCovariance)> {
        let up = pose.rotation * Vector3::z();
        let tilt = up.xy();
        // R Exp(phi) z = R z + R (phi x z).
        let turn = pose.rotation.to_rotation_matrix();
        let lean = turn.matrix() * -Vector3::z().cross_matrix();
        let mut by = Matrix2x6::zeros();
        by.fixed_view_mut::<2, 3>(0, 3)
            .copy_from(&lean.fixed_view::<2, 3>(0, 0));
        let spread = by * self.at_source * by.transpose() + Matrix2::identity() * sigma_rad.powi(2);
        let inverse = spread.try_inverse()?;
        if tilt.dot(&(inverse * tilt)) > MAX_TILT_SQUARED {
            return None;
        }
        let gain = self.at_source * by.transpose() * inverse;
        let at_source = (Matrix6::identity() - gain * by) * self.at_source;
        let upright = PoseCovariance {
            at_source: 0.5 * (at_source + at_source.transpose()),
        };
        Some((pose * se3::exp(&-(gain * tilt)), upright))
    }

    /// Covariance of [`PoseCovariance::upright`]; unchanged if `sigma_rad` is infinite.
    pub fn with_gravity(&self, pose: &Isometry3<f64>, sigma_rad: f64) -> Option<PoseCovariance> {
        match sigma_rad.is_finite() {
            true => self
                .upright(pose, sigma_rad)
                .map(|(_, covariance)| covariance),
            false => Some(*self),
        }
    }

    /// Inflates the covariance for an alternative pose of a given probability.
    pub fn with_alternative(
        self,
        pose: &Isometry3<f64>,
        alternative: &Isometry3<f64>,
        probability: f64,
    ) -> PoseCovariance {
        let off = se3::log(&(pose.inverse() * alternative));
        // Variance of a Bernoulli choice between the two poses.
        let spread = probability * (1.0 - probability) * off * off.transpose();
        // Similar alternatives repeat: the widest counts, not their sum.
        let here = off.dot(&(self.at_source * off));
        let wider = off.dot(&(spread * off)) > here;
        match wider {
            true => PoseCovariance {
                at_source: self.at_source + spread,
            },
            false => self,
        }
    }

    /// Converts to the order of `geometry_msgs/PoseWithCovariance`, about the axes of the target frame.
    pub fn in_target(&self, target_from_source: &Isometry3<f64>) -> Matrix6<f64> {
        let turn = target_from_source.rotation.to_rotation_matrix();
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
        both * self.at_source * both.transpose()
    }

    /// Standard deviations along the principal directions of the translation of a source point and of the rotation.
    ///
    /// Directions are in the target frame, the largest first of each kind.
    pub fn directions(
        &self,
        target_from_source: &Isometry3<f64>,
        about: &Point3<f64>,
    ) -> Vec<WeakDirection> {
        let turn = target_from_source.rotation;
        let lever = Matrix3x6::from_fn(|row, column| match column {
            0..3 => f64::from(u8::from(row == column)),
            _ => -about.coords.cross_matrix()[(row, column - 3)],
        });
        let place = lever * self.at_source * lever.transpose();
        let turning: Matrix3<f64> = self.at_source.fixed_view::<3, 3>(3, 3).into_owned();
        let kinds = [
            (DirectionKind::Translation, place),
            (DirectionKind::Rotation, turning),
        ];
        let mut all = Vec::new();
        for (kind, covariance) in kinds {
            let eigen = covariance.symmetric_eigen();
            let mut axes: Vec<(f64, Vector3<f64>)> = (eigen.eigenvalues.iter().copied())
                .zip(eigen.eigenvectors.column_iter().map(|c| c.into_owned()))
                .collect();
            axes.sort_by(|a, b| b.0.total_cmp(&a.0));
            all.extend(axes.into_iter().map(|(variance, axis)| WeakDirection {
                axis: turn * axis,
                kind,
                sigma: variance.max(0.0).sqrt(),
            }));
        }
        all
    }
}

/// Information matrix of a pose, and the part caused by errors of the normals.
#[derive(Clone, Copy, Default)]
struct Information {
    all: Matrix6<f64>,
    of_errors: Matrix6<f64>,
}

impl Information {
    fn add(&mut self, weight: f64, lever: &Vector6<f64>, sine_squared: f64, point: &Point3<f64>) {
        self.all += lever * weight * lever.transpose();
        // Errors of the normal are isotropic along the surface.
        let cross = point.coords.cross_matrix();
        let mut isotropic = Matrix3x6::zeros();
        isotropic.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        isotropic.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
        let along = isotropic.transpose() * isotropic - lever * lever.transpose();
        self.of_errors += along * (weight * MEAN_NORMAL_VARIANCE * sine_squared);
    }

    /// Inverse of the corrected information matrix; `None` if there is no information.
    fn inverse(&self) -> Option<Matrix6<f64>> {
        let eigen = self.all.symmetric_eigen();
        let most = eigen.eigenvalues.max();
        if !(most.is_finite() && most > 0.0) {
            return None;
        }
        let root = |value: f64| 1.0 / value.max(MIN_RELATIVE_INFORMATION * most).sqrt();
        let whitened = eigen.eigenvectors * Matrix6::from_diagonal(&eigen.eigenvalues.map(root));
        let left = whitened.transpose() * (self.all - self.of_errors) * whitened;
        let left = (0.5 * (left + left.transpose())).symmetric_eigen();
        let basis = whitened * left.eigenvectors;
        let inverse = left.eigenvalues.map(|value| 1.0 / value.max(MIN_REMAINING));
        Some(basis * Matrix6::from_diagonal(&inverse) * basis.transpose())
    }
}

/// Mean of two unit normals of arbitrary sign; `None` if it is undefined.
fn mean_normal(ours: &Vector3<f64>, theirs: &Vector3<f64>) -> Option<Vector3<f64>> {
    let sign = 1.0_f64.copysign(ours.dot(theirs));
    (theirs + ours * sign).try_normalize(1e-6)
}

/// Negative derivative of a point's residual across a surface by a right perturbation of the pose (rho, phi).
fn lever(
    target_from_source: &Isometry3<f64>,
    point: &Point3<f64>,
    across: &Vector3<f64>,
) -> Vector6<f64> {
    let across = target_from_source.inverse_transform_vector(across);
    let turning = point.coords.cross(&across);
    Vector6::new(
        across.x, across.y, across.z, turning.x, turning.y, turning.z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::{PrepareOptions, SemanticCloud};
    use nalgebra::UnitQuaternion;

    const SPACING_M: f64 = 0.05;

    /// Points of walls of 2 m by 2 m with these normals, each moved by up to a centimetre across its wall, otherwise
    /// for each seed.
    fn walls(normals: &[Vector3<f64>], seed: u64) -> PreparedCloud {
        let mut state = seed;
        let mut noise_m = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            0.02 * ((state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5)
        };
        let mut points_m = Vec::new();
        for normal in normals {
            let along = Vector3::new(normal.y, normal.z, normal.x);
            let other = Vector3::new(normal.z, normal.x, normal.y);
            for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))) {
                let [i, j] = [i, j].map(|k| SPACING_M * (f64::from(k) + 0.5));
                points_m.push(Point3::from(along * i + other * j + normal * noise_m()));
            }
        }
        let labels = Vec::new();
        let cloud = SemanticCloud { points_m, labels };
        PreparedCloud::new(cloud, &PrepareOptions::default()).unwrap()
    }

    /// Covariance of walls, given the sides of the regions that err.
    fn covariance(
        normals: &[Vector3<f64>],
        region_m: f64,
        within_m: Option<f64>,
    ) -> PoseCovariance {
        let model = ErrorModel {
            region_m,
            within_m,
            sigma_m: 0.02,
            point_m: 0.01,
            spacing_m: SPACING_M,
            scale_sigma: 0.0,
            center: Point3::origin(),
            gate_m: 6.0 * SPACING_M,
        };
        let (source, target) = (walls(normals, 1), walls(normals, 2));
        PoseCovariance::at(&source, &target, &Isometry3::identity(), &model).unwrap()
    }

    /// Standard deviations of the place, metres, the largest first.
    fn sigmas(normals: &[Vector3<f64>]) -> [f64; 3] {
        let pose = Isometry3::identity();
        let covariance = covariance(normals, 1.0, None);
        let (_, covariance) = covariance.upright(&pose, 0.006).unwrap();
        let all = covariance.directions(&pose, &Point3::new(1.0, 1.0, 1.0));
        [all[0].sigma, all[1].sigma, all[2].sigma]
    }

    #[test]
    fn a_wall_holds_a_pose_across_it_only_however_its_normals_scatter() {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let [first, second, third] = sigmas(&[x]);
        assert!(first > 0.1 && second > 0.1 && third < 0.01);
        let [first, second, _] = sigmas(&[x, y]);
        assert!(first > 0.05 && second < 0.01);
        assert!(sigmas(&[x, y, z])[0] < 0.01);
    }

    #[test]
    fn a_source_of_one_region_errs_within_it_too() {
        let normals = [Vector3::x(), Vector3::y(), Vector3::z()];
        let turn = |covariance: PoseCovariance| {
            covariance.at_source.fixed_view::<3, 3>(3, 3).trace().sqrt()
        };
        let whole = turn(covariance(&normals, 8.0, None));
        let within = turn(covariance(&normals, 8.0, Some(0.5)));
        assert!(within > 2.0 * whole, "{within} {whole}");
    }

    #[test]
    fn a_pose_that_leans_a_little_is_set_upright() {
        let turn = UnitQuaternion::from_euler_angles(0.02, -0.03, 1.2);
        let pose = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), turn);
        let loose = PoseCovariance {
            at_source: Matrix6::identity() * 1e-3,
        };
        let (upright, covariance) = loose.upright(&pose, 1e-4).unwrap();
        assert!((upright.rotation * Vector3::z()).xy().norm() < 1e-3);
        assert!((upright.rotation.euler_angles().2 - 1.2).abs() < 2e-3);
        assert!(covariance.at_source[(3, 3)] < 1e-6 && covariance.at_source[(5, 5)] > 9e-4);
        // Held by its surfaces it stays where it is; an unexplained tilt is left.
        let held = PoseCovariance {
            at_source: Matrix6::identity() * 1e-8,
        };
        let (stays, _) = held.upright(&pose, 0.02).unwrap();
        assert!(stays.rotation.angle_to(&turn) < 1e-5);
        assert!(held.upright(&pose, 1e-3).is_none());
    }
}
