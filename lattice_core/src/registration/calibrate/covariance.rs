//! How sure a pose is.

use nalgebra::{Isometry3, Matrix3, Matrix3x6, Matrix6, Point3, Vector3, Vector6};
use rustc_hash::FxHashMap;

use super::super::PreparedCloud;
use super::types::{DirectionKind, WeakDirection};

/// Distance in standard deviations at which a point counts half.
const KERNEL: f64 = 3.0;

/// Covariance of a pose by the scatter of the pull of whole regions (a sandwich estimate with
/// clusters): points of a region err together, which the inverse Hessian alone does not know.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PoseCovariance {
    /// Of a motion and a turn in the source frame (rho, phi; right perturbation).
    pub at_source: Matrix6<f64>,
}

/// What the covariance is computed from.
pub(super) struct Regions {
    /// Side of a region, metres.
    pub side_m: f64,
    /// Farthest that a partner may be, metres.
    pub gate_m: f64,
    /// Standard deviation that even the best map leaves, metres and radians.
    pub floor: (f64, f64),
}

impl PoseCovariance {
    /// At a pose; None if the points do not hold it at all.
    pub fn at(
        source: &PreparedCloud,
        target: &PreparedCloud,
        target_from_source: &Isometry3<f64>,
        regions: &Regions,
    ) -> Option<PoseCovariance> {
        let turn = target_from_source.rotation.to_rotation_matrix();
        let turn = turn.matrix();
        let mut hessian = Matrix6::zeros();
        let mut pulls: FxHashMap<[i64; 3], Vector6<f64>> = FxHashMap::default();
        for (point, spread) in source.points_m().iter().zip(source.covariances_m2()) {
            let place = target_from_source * point;
            let Some((j, _)) = target.nearest(&place, regions.gate_m) else {
                continue;
            };
            let (Some(q), Some(n)) = (target.points_m().get(j), target.normals().get(j)) else {
                continue;
            };
            let flat = 1.0 - target.plane_epsilon();
            let c = Matrix3::identity() - flat * n * n.transpose();
            let Some(m) = (c + turn * spread * turn.transpose()).try_inverse() else {
                continue;
            };
            let r = q - place;
            let jacobian = jacobian(turn, point);
            let weight = 1.0 / (1.0 + r.dot(&(m * r)) / (KERNEL * KERNEL));
            hessian += jacobian.transpose() * m * jacobian * weight;
            let region = [point.x, point.y, point.z].map(|c| (c / regions.side_m).floor() as i64);
            *pulls.entry(region).or_insert_with(Vector6::zeros) +=
                jacobian.transpose() * m * r * weight;
        }
        // In the order of the regions, so that the sum is the same every time.
        let mut pulls: Vec<_> = pulls.into_iter().collect();
        pulls.sort_by_key(|(region, _)| *region);
        let n = pulls.len() as f64;
        if n < 7.0 {
            return None;
        }
        let scatter: Matrix6<f64> = pulls.iter().map(|(_, g)| g * g.transpose()).sum();
        let inverse = hessian.try_inverse()?;
        let mut at_source = inverse * scatter * inverse * (n / (n - 6.0));
        for i in 0..3 {
            at_source[(i, i)] += regions.floor.0 * regions.floor.0;
            at_source[(i + 3, i + 3)] += regions.floor.1 * regions.floor.1;
        }
        let finite = at_source.iter().all(|c| c.is_finite());
        finite.then_some(PoseCovariance { at_source })
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

/// Of q - T p by a motion and a turn on the right of T.
fn jacobian(turn: &Matrix3<f64>, point: &Point3<f64>) -> Matrix3x6<f64> {
    let mut jacobian = Matrix3x6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
    let lever = turn * point.coords.cross_matrix();
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    jacobian
}
