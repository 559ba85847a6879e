//! Correction of a mount and of the time of its points.

use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3};

use super::BasePose;

/// Correction of a stated mount: a rotation in the base frame about the sensor, a shift, and a time offset.
#[derive(Clone, Debug, PartialEq)]
pub struct MountCorrection {
    /// Rotation about the axes of the base through the sensor.
    pub rotation: UnitQuaternion<f64>,
    /// Change of the lever arm, metres.
    pub shift_m: Vector3<f64>,
    /// Time added to the stamps of points, seconds.
    pub time_s: f64,
    sensor_m: Vector3<f64>,
}

impl MountCorrection {
    /// No correction of a sensor at `sensor_m` in the base frame.
    pub fn identity(sensor_m: Vector3<f64>) -> MountCorrection {
        MountCorrection {
            rotation: UnitQuaternion::identity(),
            shift_m: Vector3::zeros(),
            time_s: 0.0,
            sensor_m,
        }
    }

    /// `base_from_base`: takes points by the stated mount to points by the corrected one, metres.
    pub fn base_from_stated(&self) -> Isometry3<f64> {
        let shift = self.sensor_m + self.shift_m - self.rotation * self.sensor_m;
        Isometry3::from_parts(Translation3::from(shift), self.rotation)
    }

    /// Position of the sensor in the base frame, metres.
    pub(super) fn sensor_m(&self) -> Vector3<f64> {
        self.sensor_m + self.shift_m
    }

    /// Rotation vector, shift and time as one vector.
    pub(super) fn vector(&self) -> SVector<f64, 7> {
        let turn = self.rotation.scaled_axis();
        let shift = self.shift_m;
        SVector::from([
            turn.x,
            turn.y,
            turn.z,
            shift.x,
            shift.y,
            shift.z,
            self.time_s,
        ])
    }

    /// Correction of a vector.
    pub(super) fn of(&self, vector: &SVector<f64, 7>) -> MountCorrection {
        MountCorrection {
            rotation: UnitQuaternion::from_scaled_axis(vector.fixed_rows::<3>(0).into_owned()),
            shift_m: vector.fixed_rows::<3>(3).into_owned(),
            time_s: vector[6],
            sensor_m: self.sensor_m,
        }
    }

    /// Poses of the base with the time offset.
    pub(super) fn map_from_base(&self, pose: &BasePose) -> Isometry3<f64> {
        if self.time_s == 0.0 {
            return pose.map_from_base;
        }
        let turn = UnitQuaternion::from_scaled_axis(pose.rate_rad_per_s * self.time_s);
        let position = pose.map_from_base.translation.vector + pose.velocity_m_per_s * self.time_s;
        Isometry3::from_parts(
            Translation3::from(position),
            turn * pose.map_from_base.rotation,
        )
    }
}
