//! Covariance of a pose.

use std::collections::BTreeMap;

use nalgebra::{
    Isometry3, Matrix2, Matrix2x6, Matrix3, Matrix3x6, Matrix6, Matrix6x3, Point3, Vector3, Vector6,
};
use rustc_hash::FxHashMap;

use super::super::PreparedCloud;
use super::super::likelihood::region_of;
use super::types::{DirectionKind, WeakDirection};
use crate::pose::se3;

/// Distance in standard deviations at which a point counts half.
const KERNEL: f64 = 3.0;
/// Squared tilt in standard deviations that is still believed; one in ten thousand is larger.
const MAX_TILT_SQUARED: f64 = 18.4;

/// Covariance of a pose whose source is a surface that is wrong by whole regions.
///
/// Points of a region err together (a mesh is bent, a depth camera is off), which the inverse Hessian
/// does not know: it would be far too small (Bonnabel et al., arXiv 1410.7632). So the pull of each
/// region is what varies, once as the residuals show it and once as the source is known to err:
/// H^-1 (sum over regions of the covariance of their pulls) H^-1.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PoseCovariance {
    /// Covariance of a motion and a turn in the source frame (rho, phi; right perturbation).
    pub at_source: Matrix6<f64>,
}

pub(super) struct ErrorModel {
    /// Side of a region that errs as one, metres.
    pub region_m: f64,
    /// Standard deviation of a region's place along each axis, metres.
    pub sigma_m: f64,
    /// Standard deviation of the source's scale.
    pub scale_sigma: f64,
    /// Place in the source from which its scale counts.
    pub center: Point3<f64>,
    /// Farthest that a partner may be, metres.
    pub gate_m: f64,
}

/// Pull of the points of a region on the pose.
struct Pull {
    residual: Vector6<f64>,
    motion: Matrix6x3<f64>,
}

impl PoseCovariance {
    /// At a pose; None if the points do not hold it at all.
    pub fn at(
        source: &PreparedCloud,
        target: &PreparedCloud,
        target_from_source: &Isometry3<f64>,
        model: &ErrorModel,
    ) -> Option<PoseCovariance> {
        let mut hessian = Matrix6::zeros();
        let mut scaling = Vector6::zeros();
        let mut pulls: FxHashMap<[i64; 3], Pull> = FxHashMap::default();
        for term in terms(source, target, target_from_source, 1.0, model) {
            let lever = term.jacobian.transpose() * term.weight;
            hessian += lever * term.jacobian;
            scaling += lever * term.stretch;
            let region = region_of(&term.point, model.region_m);
            let pull = pulls.entry(region).or_insert_with(|| Pull {
                residual: Vector6::zeros(),
                motion: Matrix6x3::zeros(),
            });
            pull.residual += lever * term.residual;
            pull.motion += lever;
        }
        // In the order of the regions, so that the sum is the same every time.
        let mut pulls: Vec<_> = pulls.into_iter().collect();
        pulls.sort_by_key(|(region, _)| *region);
        let mut scatter = model.scale_sigma.powi(2) * scaling * scaling.transpose();
        for (_, pull) in &pulls {
            scatter += pull.residual * pull.residual.transpose();
            scatter += model.sigma_m.powi(2) * pull.motion * pull.motion.transpose();
        }
        let inverse = hessian.try_inverse()?;
        let at_source = inverse * scatter * inverse;
        let finite = at_source.iter().all(|c| c.is_finite());
        (finite && !pulls.is_empty()).then_some(PoseCovariance { at_source })
    }

    /// At a pose, of what points tell across the surfaces of their partners: a plane holds nothing along itself, though
    /// the nearest point of it does. Each region of the source counts as one point. None without six directions.
    pub fn across_surfaces(
        source: &PreparedCloud,
        target: &PreparedCloud,
        target_from_source: &Isometry3<f64>,
        model: &ErrorModel,
    ) -> Option<PoseCovariance> {
        let turn = *target_from_source.rotation.to_rotation_matrix().matrix();
        let mut regions: BTreeMap<[i64; 3], (Matrix6<f64>, f64)> = BTreeMap::new();
        for point in source.points_m() {
            let near = target.nearest(&(target_from_source * point), model.gate_m);
            let Some(n) = near.and_then(|(j, _)| target.normals().get(j)) else {
                continue;
            };
            let lever = jacobian(&turn, point).transpose() * n;
            let region = regions.entry(region_of(point, model.region_m));
            let (sum, points) = region.or_default();
            *sum += lever * lever.transpose();
            *points += 1.0;
        }
        let all = regions.values().map(|(sum, points)| sum / *points);
        let at_source = all.sum::<Matrix6<f64>>().try_inverse()? * model.sigma_m.powi(2);
        let finite = at_source.iter().all(|c| c.is_finite());
        finite.then_some(PoseCovariance { at_source })
    }

    /// The pose and its covariance when both frames are known to stand upright up to `sigma_rad`.
    ///
    /// A Kalman update with the tilt as measurement. None if the pose leans by more than both can
    /// explain: then one of the frames does not stand upright.
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

    /// As wide as it takes for another pose to be that probable.
    pub fn with_rival(
        self,
        pose: &Isometry3<f64>,
        rival: &Isometry3<f64>,
        probability: f64,
    ) -> PoseCovariance {
        let off = se3::log(&(pose.inverse() * rival));
        // Variance of a choice between the two.
        let spread = probability * (1.0 - probability) * off * off.transpose();
        // Rivals of one kind come many times: the widest counts, not their sum.
        let here = off.dot(&(self.at_source * off));
        let wider = off.dot(&(spread * off)) > here;
        match wider {
            true => PoseCovariance {
                at_source: self.at_source + spread,
            },
            false => self,
        }
    }

    /// In the order of `geometry_msgs/PoseWithCovariance`, about the axes of the target frame.
    pub fn in_target(&self, target_from_source: &Isometry3<f64>) -> Matrix6<f64> {
        let turn = target_from_source.rotation.to_rotation_matrix();
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
        both * self.at_source * both.transpose()
    }

    /// Standard deviations along the principal directions, in the target frame, the largest first of
    /// each kind: of the place of a source point, and of the orientation.
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

/// A source point and its partner, linearised at a pose and a scale.
pub(super) struct Term {
    pub point: Point3<f64>,
    /// Partner minus the point's place.
    pub residual: Vector3<f64>,
    /// Derivative of that by a motion and a turn on the right of the pose.
    pub jacobian: Matrix3x6<f64>,
    /// The opposite of its derivative by the scale.
    pub stretch: Vector3<f64>,
    /// Inverse covariance, times what the kernel leaves of it.
    pub weight: Matrix3<f64>,
}

/// The points of a source that have a partner near their place.
pub(super) fn terms<'a>(
    source: &'a PreparedCloud,
    target: &'a PreparedCloud,
    target_from_source: &'a Isometry3<f64>,
    scale: f64,
    model: &'a ErrorModel,
) -> impl Iterator<Item = Term> + 'a {
    let turn = *target_from_source.rotation.to_rotation_matrix().matrix();
    let points = source.points_m().iter().zip(source.covariances_m2());
    points.filter_map(move |(point, spread)| {
        let stretch = turn * (point - model.center);
        let place = target_from_source * point + (scale - 1.0) * stretch;
        let (j, _) = target.nearest(&place, model.gate_m)?;
        let (q, n) = (target.points_m().get(j)?, target.normals().get(j)?);
        let flat = 1.0 - target.plane_epsilon();
        let c = Matrix3::identity() - flat * n * n.transpose();
        let m = (c + turn * spread * turn.transpose()).try_inverse()?;
        let residual = q - place;
        let kernel = 1.0 / (1.0 + residual.dot(&(m * residual)) / (KERNEL * KERNEL));
        Some(Term {
            point: *point,
            residual,
            jacobian: jacobian(&turn, point),
            stretch,
            weight: m * kernel,
        })
    })
}

/// Jacobian of q - T p by a motion and a turn on the right of T.
fn jacobian(turn: &Matrix3<f64>, point: &Point3<f64>) -> Matrix3x6<f64> {
    let mut jacobian = Matrix3x6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
    let lever = turn * point.coords.cross_matrix();
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    jacobian
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn a_pose_that_leans_a_little_is_set_upright() {
        let turn = UnitQuaternion::from_euler_angles(0.02, -0.03, 1.2);
        let pose = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), turn);
        let loose = PoseCovariance {
            at_source: Matrix6::identity() * 1e-3,
        };
        let (upright, sure) = loose.upright(&pose, 1e-4).unwrap();
        assert!((upright.rotation * Vector3::z()).xy().norm() < 1e-3);
        assert!((upright.rotation.euler_angles().2 - 1.2).abs() < 2e-3);
        assert!(sure.at_source[(3, 3)] < 1e-6 && sure.at_source[(5, 5)] > 9e-4);
        // Held by its surfaces it stays where it is; a lean that nothing explains is left alone.
        let held = PoseCovariance {
            at_source: Matrix6::identity() * 1e-8,
        };
        let (stays, _) = held.upright(&pose, 0.02).unwrap();
        assert!(stays.rotation.angle_to(&turn) < 1e-5);
        assert!(held.upright(&pose, 1e-3).is_none());
    }
}
