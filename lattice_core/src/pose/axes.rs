//! Axis conventions of headsets and cameras, and their conversion to that of ROS.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Matrix3, Point3, Vector3};
use thiserror::Error;

/// Axis convention of a frame; ROS has x forward, y left, z up (REP 103).
///
/// Conversions permute and negate coordinates and are exact.
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

/// Unknown name of an axis convention.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[error("unknown axes '{0}', expected ros_flu, unity_ruf, winrt_rub or optical")]
pub struct UnknownAxes(pub String);

impl Axes {
    /// All axis conventions.
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

    /// Matrix from these axes to those of ROS; its determinant is -1 for left-handed axes.
    pub fn matrix(self) -> Matrix3<f64> {
        let unit = [Vector3::x(), Vector3::y(), Vector3::z()];
        Matrix3::from_columns(&unit.map(|axis| self.to_ros(axis)))
    }

    /// Converts a vector to the axes of ROS.
    pub fn to_ros(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Axes::RosFlu => v,
            Axes::UnityRuf => Vector3::new(v.z, -v.x, v.y),
            Axes::WinrtRub => Vector3::new(-v.z, -v.x, v.y),
            Axes::Optical => Vector3::new(v.z, -v.x, -v.y),
        }
    }

    /// Converts a vector from the axes of ROS.
    pub fn from_ros(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Axes::RosFlu => v,
            Axes::UnityRuf => Vector3::new(-v.y, v.z, v.x),
            Axes::WinrtRub => Vector3::new(-v.y, v.z, -v.x),
            Axes::Optical => Vector3::new(-v.y, -v.z, v.x),
        }
    }

    /// Converts a point to the axes of ROS.
    pub fn point_to_ros(self, p: &Point3<f64>) -> Point3<f64> {
        self.to_ros(p.coords).into()
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

    #[test]
    fn the_matrices_are_those_of_the_definitions_and_the_way_back_is_exact() {
        let unity = Matrix3::new(0., 0., 1., -1., 0., 0., 0., 1., 0.);
        let winrt = Matrix3::new(0., 0., -1., -1., 0., 0., 0., 1., 0.);
        let optical = Matrix3::new(0., 0., 1., -1., 0., 0., 0., -1., 0.);
        let expected = [Matrix3::identity(), unity, winrt, optical];
        let v = Vector3::new(0.1, -0.7, 1e9 / 3.0);
        for (axes, expected) in Axes::ALL.into_iter().zip(expected) {
            assert_eq!(axes.matrix(), expected, "{axes}");
            assert_eq!(axes.from_ros(axes.to_ros(v)), v, "{axes}");
            assert_eq!(axes.name().parse(), Ok(axes));
        }
        assert!("unity".parse::<Axes>().is_err());
    }
}
