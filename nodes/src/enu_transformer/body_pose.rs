//! Poses of bodies on the machine, as messages state them.

use std::sync::Arc;

use nalgebra::Isometry3;

/// Frame of the position or attitude in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Body {
    /// The machine: no mount applies.
    Base,
    /// An INS in this frame, without leading slash; empty if the message names none.
    Ins(Arc<str>),
}

impl Body {
    pub(super) fn ins(frame: &str) -> Self {
        Self::Ins(frame.trim_start_matches('/').into())
    }
}

/// Pose from a message, before its mount and reference frame are applied.
#[derive(Clone, Debug)]
pub struct BodyPose {
    /// Nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Reference frame, without leading slash; `None`: the map frame.
    pub reference: Option<Arc<str>>,
    /// `reference_from_body`: position of the first body, attitude of the second; metres.
    pub pose: Isometry3<f64>,
    /// Frame of the position.
    pub position_of: Body,
    /// Frame of the attitude.
    pub attitude_of: Body,
}
