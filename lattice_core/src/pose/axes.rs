//! Axes that headsets and cameras use, and the way to those of ROS.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

/// Which way x, y and z point in a frame; ROS has x forward, y left, z up (REP 103).
///
/// The conversions move and negate numbers and so are exact. A rotation `R` becomes `M R M^T` with
/// the [`Axes::matrix`] `M`, also where `M` is a mirror; so does a pose, whose two frames both change
/// their axes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Axes {
    /// Forward, left, up: ROS.
    #[default]
    RosFlu,
    /// Right, up, forward: Unity. Left-handed.
    UnityRuf,
    /// Right, up, backward: WinRT, OpenXR.
    WinrtRub,
    /// Right, down, forward: cameras.
    Optical,
}

/// A name that is none of [`Axes::ALL`].
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[error("unknown axes '{0}', expected ros_flu, unity_ruf, winrt_rub or optical")]
pub struct UnknownAxes(pub String);

impl Axes {
    /// All of them.
    pub const ALL: [Axes; 4] = [Axes::RosFlu, Axes::UnityRuf, Axes::WinrtRub, Axes::Optical];

    /// Name in parameters.
    pub fn name(self) -> &'static str {
        match self {
            Axes::RosFlu => "ros_flu",
            Axes::UnityRuf => "unity_ruf",
            Axes::WinrtRub => "winrt_rub",
            Axes::Optical => "optical",
        }
    }

    /// `M`, which takes coordinates in these axes to those in the axes of ROS; its determinant is -1
    /// for left-handed axes.
    pub fn matrix(self) -> Matrix3<f64> {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        Matrix3::from_columns(&[x, y, z].map(|axis| self.to_ros(axis)))
    }

    /// Whether x, y and z are like the first fingers of the left hand.
    pub fn is_left_handed(self) -> bool {
        self == Axes::UnityRuf
    }

    /// A vector in the axes of ROS.
    pub fn to_ros(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Axes::RosFlu => v,
            Axes::UnityRuf => Vector3::new(v.z, -v.x, v.y),
            Axes::WinrtRub => Vector3::new(-v.z, -v.x, v.y),
            Axes::Optical => Vector3::new(v.z, -v.x, -v.y),
        }
    }

    /// A vector of ROS in these axes.
    pub fn from_ros(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Axes::RosFlu => v,
            Axes::UnityRuf => Vector3::new(-v.y, v.z, v.x),
            Axes::WinrtRub => Vector3::new(-v.y, v.z, -v.x),
            Axes::Optical => Vector3::new(-v.y, -v.z, v.x),
        }
    }

    /// A point in the axes of ROS.
    pub fn point_to_ros(self, p: &Point3<f64>) -> Point3<f64> {
        self.to_ros(p.coords).into()
    }

    /// An axial vector, such as an angular velocity, in the axes of ROS: a mirror turns it round.
    pub fn axial_to_ros(self, v: Vector3<f64>) -> Vector3<f64> {
        let v = self.to_ros(v);
        if self.is_left_handed() { -v } else { v }
    }

    /// An axial vector of ROS in these axes.
    pub fn axial_from_ros(self, v: Vector3<f64>) -> Vector3<f64> {
        let v = self.from_ros(v);
        if self.is_left_handed() { -v } else { v }
    }

    /// A rotation in the axes of ROS: the imaginary part is an axial vector, the real part stays.
    pub fn rotation_to_ros(self, q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let imaginary = self.axial_to_ros(q.imag());
        UnitQuaternion::new_unchecked(Quaternion::from_parts(q.w, imaginary))
    }

    /// A rotation of ROS in these axes.
    pub fn rotation_from_ros(self, q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let imaginary = self.axial_from_ros(q.imag());
        UnitQuaternion::new_unchecked(Quaternion::from_parts(q.w, imaginary))
    }

    /// A pose in the axes of ROS, `M T M^-1`.
    pub fn pose_to_ros(self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let translation = self.to_ros(pose.translation.vector);
        Isometry3::from_parts(
            Translation3::from(translation),
            self.rotation_to_ros(&pose.rotation),
        )
    }

    /// A pose of ROS in these axes, `M^-1 T M`.
    pub fn pose_from_ros(self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let translation = self.from_ros(pose.translation.vector);
        Isometry3::from_parts(
            Translation3::from(translation),
            self.rotation_from_ros(&pose.rotation),
        )
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Axes {
    type Err = UnknownAxes;

    fn from_str(name: &str) -> Result<Axes, UnknownAxes> {
        let found = Axes::ALL.into_iter().find(|axes| axes.name() == name);
        found.ok_or_else(|| UnknownAxes(name.chars().take(32).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotations() -> Vec<UnitQuaternion<f64>> {
        let angles = [-2.9, -0.4, 0.0, 0.3, 1.2, 3.0];
        let of = |r, p, y| UnitQuaternion::from_euler_angles(r, p, y);
        let pairs = angles.iter().flat_map(|&r| angles.map(|p| (r, p)));
        pairs
            .flat_map(|(r, p)| angles.map(|y| of(r, p, y)))
            .collect()
    }

    #[test]
    fn the_matrices_are_those_of_the_definitions() {
        let unity = Matrix3::new(0., 0., 1., -1., 0., 0., 0., 1., 0.);
        let winrt = Matrix3::new(0., 0., -1., -1., 0., 0., 0., 1., 0.);
        let optical = Matrix3::new(0., 0., 1., -1., 0., 0., 0., -1., 0.);
        assert_eq!(Axes::RosFlu.matrix(), Matrix3::identity());
        assert_eq!(Axes::UnityRuf.matrix(), unity);
        assert_eq!(Axes::WinrtRub.matrix(), winrt);
        assert_eq!(Axes::Optical.matrix(), optical);
        for axes in Axes::ALL {
            let determinant = if axes.is_left_handed() { -1.0 } else { 1.0 };
            assert_eq!(axes.matrix().determinant(), determinant, "{axes}");
            assert_eq!(axes.name().parse(), Ok(axes));
        }
        assert!("unity".parse::<Axes>().is_err());
    }

    #[test]
    fn quaternions_are_those_of_the_formulas() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.9);
        let [x, y, z, w] = <[f64; 4]>::from(q.coords);
        let coords = |q: UnitQuaternion<f64>| <[f64; 4]>::from(q.coords);
        assert_eq!(coords(Axes::UnityRuf.rotation_to_ros(&q)), [-z, x, -y, w]);
        assert_eq!(coords(Axes::WinrtRub.rotation_to_ros(&q)), [-z, -x, y, w]);
        // The same rotation as (-qy, qz, qx, -qw).
        assert_eq!(coords(Axes::UnityRuf.rotation_from_ros(&q)), [y, -z, -x, w]);
        let omega = Vector3::new(0.1, 0.2, 0.3);
        let ros = Axes::UnityRuf.axial_to_ros(omega);
        assert_eq!(ros, Vector3::new(-0.3, 0.1, -0.2));
    }

    #[test]
    fn rotations_and_poses_turn_as_the_matrices_do() {
        for axes in Axes::ALL {
            let m = axes.matrix();
            for q in rotations() {
                let expected = m * q.to_rotation_matrix().matrix() * m.transpose();
                let found = axes.rotation_to_ros(&q);
                let found = found.to_rotation_matrix();
                assert!((found.matrix() - expected).norm() < 1e-14, "{axes}");

                let pose = Isometry3::from_parts(Translation3::new(1.0, -2.0, 3.5), q);
                let ros = axes.pose_to_ros(&pose);
                let p = Point3::new(0.4, 5.0, -6.0);
                let moved = axes.point_to_ros(&(pose * p));
                assert!(
                    (ros * axes.point_to_ros(&p) - moved).norm() < 1e-13,
                    "{axes}"
                );
            }
        }
    }

    #[test]
    fn the_way_back_is_exact() {
        for axes in Axes::ALL {
            for q in rotations() {
                let pose = Isometry3::from_parts(Translation3::new(0.1, -0.7, 1e9 / 3.0), q);
                assert_eq!(axes.pose_from_ros(&axes.pose_to_ros(&pose)), pose, "{axes}");
                assert_eq!(axes.pose_to_ros(&axes.pose_from_ros(&pose)), pose, "{axes}");
                let v = q.imag();
                assert_eq!(axes.axial_from_ros(axes.axial_to_ros(v)), v, "{axes}");
            }
        }
    }
}
