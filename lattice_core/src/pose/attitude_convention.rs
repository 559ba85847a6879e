//! Conventions of attitudes, of which REP 103 has one.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Convention of attitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AttitudeConvention {
    /// East, north, up; x forward, y left, z up (REP 103).
    #[default]
    Enu,
    /// North, east, down; x forward, y right, z down.
    Ned,
    /// Yaw clockwise from north, with roll and pitch of x forward, y left, z up.
    Compass,
    /// As [`Self::Enu`], but pitch is positive with the nose up.
    PitchUp,
    /// As [`Self::Enu`], but roll is positive with the left side down.
    RollLeft,
    /// As [`Self::Enu`], but roll and pitch are exchanged.
    Swapped,
}

impl AttitudeConvention {
    /// Conventions, the usual one first.
    pub const ALL: [AttitudeConvention; 6] = [
        Self::Enu,
        Self::Ned,
        Self::Compass,
        Self::PitchUp,
        Self::RollLeft,
        Self::Swapped,
    ];

    /// Name as in parameters.
    pub fn name(self) -> &'static str {
        match self {
            Self::Enu => "enu",
            Self::Ned => "ned",
            Self::Compass => "compass",
            Self::PitchUp => "pitch_up",
            Self::RollLeft => "roll_left",
            Self::Swapped => "swapped",
        }
    }

    /// Convention of attitudes that are of the other one once they were converted by this one; `None` if none is.
    pub fn then(self, other: Self) -> Option<Self> {
        match (self, other) {
            (one, other) if one == other => Some(Self::Enu),
            (Self::Enu, one) | (one, Self::Enu) => Some(one),
            (Self::PitchUp, Self::Compass) | (Self::Compass, Self::PitchUp) => Some(Self::Ned),
            (Self::PitchUp, Self::Ned) | (Self::Ned, Self::PitchUp) => Some(Self::Compass),
            (Self::Compass, Self::Ned) | (Self::Ned, Self::Compass) => Some(Self::PitchUp),
            _ => None,
        }
    }

    /// An attitude of this convention as `enu_from_flu`.
    pub fn to_enu(self, attitude: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let (roll, pitch, yaw) = attitude.euler_angles();
        let of = UnitQuaternion::from_euler_angles;
        match self {
            Self::Enu => *attitude,
            Self::Ned => {
                let enu_from_ned = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
                let frd_from_flu = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
                let [left, right] = [enu_from_ned, frd_from_flu]
                    .map(|axes| UnitQuaternion::from(Rotation3::from_matrix_unchecked(axes)));
                left * attitude * right
            }
            Self::Compass => of(roll, pitch, FRAC_PI_2 - yaw),
            Self::PitchUp => of(roll, -pitch, yaw),
            Self::RollLeft => of(-roll, pitch, yaw),
            Self::Swapped => of(pitch, roll, yaw),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Each convention is its own inverse.
        #[test]
        fn conventions_are_rotations(roll in -0.5..0.5_f64, pitch in -0.5..0.5_f64, yaw in -3.0..3.0_f64) {
            let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            for convention in AttitudeConvention::ALL {
                let twice = convention.to_enu(&convention.to_enu(&attitude));
                prop_assert!(twice.angle_to(&attitude) < 1e-9, "{convention:?}");
            }
            for (one, other) in [1, 2, 3].into_iter().flat_map(|one| [0, 1, 2, 3].map(|other| (one, other))) {
                let [one, other] = [one, other].map(|at: usize| AttitudeConvention::ALL[at]);
                let both = one.then(other).unwrap();
                let in_turn = other.to_enu(&one.to_enu(&attitude));
                prop_assert!(both.to_enu(&attitude).angle_to(&in_turn) < 1e-9, "{one:?} {other:?}");
            }
            let ned = AttitudeConvention::Ned.to_enu(&attitude) * Vector3::z();
            // A level sensor stays level.
            prop_assert!((ned.z - (attitude * Vector3::z()).z).abs() < 1e-9);
        }
    }
}
