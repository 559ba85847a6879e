//! Reasons for rejecting INS messages.

use thiserror::Error;

use super::speed_gate::TooFast;
use super::stamp_order::Refused;

/// Reason for rejecting an INS message.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum InsRefusal {
    /// No INS solution.
    #[error(
        "INS status is {status}, expected 3 (INS_SOLUTION_GOOD), 6 (INS_SOLUTION_FREE) or 7 (INS_ALIGNMENT_COMPLETE)"
    )]
    NoSolution { status: u32 },
    /// No position fix.
    #[error("fix status is {status} ({}), expected 0 or more", fix_status(*status))]
    NoFix { status: i8 },
    /// No attitude.
    #[error(
        "orientation covariance is -1: the Imu has no orientation (REP 145); run an attitude filter such as imu_filter_madgwick, or choose another source of poses (`ins.source`)"
    )]
    NoOrientation,
    /// Invalid latitude, longitude or height.
    #[error("{problem}")]
    Place { problem: String },
    /// Zero latitude and longitude of a receiver without a position.
    #[error(
        "latitude and longitude are 0: the receiver has no position; for a place there set `origin.mode: fixed` and `origin.latitude_deg`, `origin.longitude_deg` near it"
    )]
    NullIsland,
    /// Missing height.
    #[error(
        "altitude is NaN: the receiver gives no height (NavSatFix allows that); have the driver publish a 3D fix, or choose another source of poses (`ins.source`)"
    )]
    NoHeight,
    /// Stamp of another time.
    #[error("{}", stamp_text(.0))]
    Stamp(Refused),
    /// Unreachable position.
    #[error(
        "position is {distance_m:.1} m from that {time_s:.3} s before, over {max_speed_m_per_s} m/s (`ins.max_speed_m_per_s`)"
    )]
    TooFast {
        distance_m: f64,
        time_s: f64,
        max_speed_m_per_s: f64,
    },
    /// Accepted jump to another place.
    #[error(
        "position jumped by {distance_m:.1} m in {time_s:.3} s and stayed there: the map continues there, beside its earlier part"
    )]
    Jump { distance_m: f64, time_s: f64 },
    /// Invalid pose.
    #[error("position is not finite, or the quaternion is zero or not finite")]
    Pose,
}

impl InsRefusal {
    /// Counter name.
    pub(super) fn reason(&self) -> &'static str {
        match self {
            Self::NoSolution { .. } | Self::NoFix { .. } | Self::NoOrientation => "poses_not_good",
            Self::Stamp(refused) if refused.is_near() => "poses_out_of_order",
            Self::Stamp(_) => "poses_stamp_jump",
            Self::TooFast { .. } => "poses_too_fast",
            Self::Jump { .. } => "place_jumps",
            Self::Place { .. } | Self::NullIsland | Self::NoHeight | Self::Pose => "poses_invalid",
        }
    }

    /// Step of positions faster than `max_speed_m_per_s`.
    pub(super) fn too_fast(step: &TooFast, max_speed_m_per_s: f64) -> Self {
        Self::TooFast {
            distance_m: step.distance_m,
            time_s: step.time_s,
            max_speed_m_per_s,
        }
    }

    /// Accepted step to another place.
    pub(super) fn jump(step: &TooFast) -> Self {
        Self::Jump {
            distance_m: step.distance_m,
            time_s: step.time_s,
        }
    }
}

fn fix_status(status: i8) -> &'static str {
    match status {
        -2 => "unknown: the driver has set none",
        _ => "no fix",
    }
}

fn stamp_text(refused: &Refused) -> String {
    let seconds = |ns: i64| ns as f64 * 1e-9;
    match *refused {
        Refused::SameStamp { stamp_ns } => {
            format!(
                "its stamp {:.3} s is that of the message before",
                seconds(stamp_ns)
            )
        }
        Refused::Alone {
            stamp_ns,
            newest_ns,
        } => format!(
            "its stamp {:.3} s is {:.3} s from the newest, and those around it do not agree",
            seconds(stamp_ns),
            seconds(stamp_ns.saturating_sub(newest_ns))
        ),
    }
}
