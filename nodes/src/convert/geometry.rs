//! Conversion of poses and transforms.

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::geometry_msgs::{Point, Pose, Quaternion, Transform, TransformStamped, Vector3};
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Quaternion as NaQuaternion, Translation3, UnitQuaternion};

/// Unit quaternion; `None` if it is not finite or zero.
pub fn rotation_from(q: &Quaternion) -> Option<UnitQuaternion<f64>> {
    let raw = NaQuaternion::new(q.w, q.x, q.y, q.z);
    let norm = raw.norm();
    (norm.is_finite() && norm > 1e-6).then(|| UnitQuaternion::from_quaternion(raw))
}

/// Pose as an isometry; `None` if it is not finite or the rotation is zero.
pub fn isometry_from_pose(pose: &Pose) -> Option<Isometry3<f64>> {
    let p = &pose.position;
    isometry(p.x, p.y, p.z, &pose.orientation)
}

/// Transform as an isometry; `None` if it is not finite or the rotation is zero.
pub fn isometry_from_transform(transform: &Transform) -> Option<Isometry3<f64>> {
    let t = &transform.translation;
    isometry(t.x, t.y, t.z, &transform.rotation)
}

fn isometry(x: f64, y: f64, z: f64, rotation: &Quaternion) -> Option<Isometry3<f64>> {
    let finite = x.is_finite() && y.is_finite() && z.is_finite();
    let rotation = rotation_from(rotation)?;
    finite.then(|| Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// An isometry as a pose.
pub fn pose_from(isometry: &Isometry3<f64>) -> Pose {
    let t = isometry.translation.vector;
    Pose {
        position: Point {
            x: t.x,
            y: t.y,
            z: t.z,
        },
        orientation: quaternion_from(&isometry.rotation),
    }
}

/// `parent_from_child` at a stamp, as a tf message.
pub fn transform_stamped(
    parent: &str,
    child: &str,
    stamp_ns: i64,
    parent_from_child: &Isometry3<f64>,
) -> TransformStamped {
    let t = parent_from_child.translation.vector;
    TransformStamped {
        header: header(parent, stamp_ns),
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: Vector3 {
                x: t.x,
                y: t.y,
                z: t.z,
            },
            rotation: quaternion_from(&parent_from_child.rotation),
        },
    }
}

/// A header in a frame at a stamp.
pub fn header(frame_id: &str, stamp_ns: i64) -> Header {
    Header {
        stamp: Time::from_ns(stamp_ns),
        frame_id: frame_id.to_owned(),
    }
}

fn quaternion_from(rotation: &UnitQuaternion<f64>) -> Quaternion {
    Quaternion {
        x: rotation.i,
        y: rotation.j,
        z: rotation.k,
        w: rotation.w,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3 as V;

    #[test]
    fn a_pose_survives_the_message() {
        let pose = Isometry3::new(V::new(1.0, -2.0, 3.0), V::new(0.1, 0.2, -0.3));
        let back = isometry_from_pose(&pose_from(&pose)).unwrap();
        assert!((back.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-14);
        let stamped = transform_stamped("map", "base_link", 5, &pose);
        let back = isometry_from_transform(&stamped.transform).unwrap();
        assert!((back.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-14);
        assert_eq!(stamped.header.stamp.to_ns(), 5);
    }

    #[test]
    fn numbers_without_meaning_are_refused() {
        let mut pose = pose_from(&Isometry3::identity());
        pose.orientation.w = 0.0;
        assert!(isometry_from_pose(&pose).is_none());
        pose.orientation.w = f64::NAN;
        assert!(isometry_from_pose(&pose).is_none());
        pose.orientation.w = 1.0;
        pose.position.y = f64::INFINITY;
        assert!(isometry_from_pose(&pose).is_none());
    }
}
