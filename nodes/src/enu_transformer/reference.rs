//! Reference frame of poses, and poses that wait for transforms.

use std::sync::Arc;

use super::body_pose::BodyPose;

/// Pose that waits for its transforms.
pub(super) struct WaitingPose {
    pub topic: Arc<str>,
    pub pose: BodyPose,
    pub arrived_ns: i64,
}

/// Relation of the poses' reference frame to the map frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reference {
    /// Undecided.
    Unknown,
    /// Connected with the map frame by transforms.
    OnTf,
    /// Not connected with the map frame, so it is used as the map frame.
    IsMap,
}
