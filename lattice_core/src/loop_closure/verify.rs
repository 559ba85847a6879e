//! Verification of a loop closure: the later segments registered in the earlier ones, with a verdict.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

use super::segment::{Segment, about_origin};
use crate::lattice::{Lattice, LatticeKind};
use crate::odometry::MomentMap;
use crate::pose::se3;
use crate::registration::{
    CalibrationMap, CalibrationOptions, CalibrationRequest, Profile, SemanticCloud, SourceCloud,
    Verdict, register_global,
};

/// Limit of points of a cloud.
const MAX_POINTS: usize = 200_000;
/// Lower bound of the standard deviation of the tilt between two segments, rad: that of a registration.
const TILT_SIGMA_RAD: f64 = 0.02;

/// Segments with the poses of their anchors in the map.
pub(super) type Placed<'a> = &'a [(&'a Segment, Isometry3<f64>)];

/// Registration of segments against earlier ones.
pub(super) struct Verified {
    pub verdict: Verdict,
    /// Reason for the verdict.
    pub reason: String,
    /// `target_from_source` between the anchors of both.
    pub target_from_source: Isometry3<f64>,
    /// Covariance of its twist in the target frame.
    pub covariance: Matrix6<f64>,
}

/// Registers segments, the first of which is the source, against the segments of the target, without an initial
/// guess.
///
/// `tilt_sigma_rad`: standard deviation of the tilt between both. `None` if there are too few points.
pub(super) fn register_segments(
    target: Placed,
    source: Placed,
    tilt_sigma_rad: f64,
) -> Option<Verified> {
    let ((at_target, to), (_, from)) = (target.first()?, source.first()?);
    let side_m = at_target.side_m;
    // Axes are those of the map for both, so that tilts are errors alone.
    let (target_anchor, source_anchor) = (level(to), level(from));
    let map = CalibrationMap::new(cloud_of(target, &target_anchor, side_m)?, side_m).ok()?;
    let clouds = [SourceCloud {
        cloud: cloud_of(source, &source_anchor, side_m)?,
        sensor_m: None,
    }];
    let options = CalibrationOptions {
        trust_axes: true,
        gravity_sigma_rad: tilt_sigma_rad.max(TILT_SIGMA_RAD),
        ..Profile::Lidar.options()
    };
    let request = CalibrationRequest {
        source_clouds: &clouds,
        start: None,
        confusion: None,
    };
    let found = register_global(&map, &request, &options, &());
    let place_m = &found.target_from_source.translation.vector;
    let covariance = about_origin(&found.covariance, place_m);
    let target_from_level = turn(to).inverse();
    let adjoint = se3::adjoint(&target_from_level);
    Some(Verified {
        verdict: found.verdict,
        reason: found.reason,
        target_from_source: target_from_level * found.target_from_source * turn(from),
        covariance: adjoint * covariance * adjoint.transpose(),
    })
}

/// Rotation of a pose.
fn turn(pose: &Isometry3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Vector3::zeros().into(), pose.rotation)
}

/// Pose with the same position and the axes of the map.
fn level(pose: &Isometry3<f64>) -> Isometry3<f64> {
    Isometry3::translation(pose.translation.x, pose.translation.y, pose.translation.z)
}

/// Cells of segments in a frame, given by its pose in the map.
fn cloud_of(
    segments: Placed,
    map_from_frame: &Isometry3<f64>,
    side_m: f64,
) -> Option<SemanticCloud> {
    let lattice = Lattice::new(LatticeKind::Fcc, side_m.powi(3)).ok()?;
    let mut cells = MomentMap::new(lattice, MAX_POINTS);
    for (segment, map_from_anchor) in segments {
        let pose = map_from_frame.inverse() * map_from_anchor;
        let points: Vec<_> = segment.points_at(&pose).collect();
        cells.add(&points);
    }
    let points = cells.centroids_m().into_iter().map(Point3::from);
    Some(SemanticCloud::unlabelled(points.collect()))
}
