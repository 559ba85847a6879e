//! Outcomes and errors of map messages.

use thiserror::Error;

use crate::convert::map::MapMessageError;

/// Reason for rejecting a map message. The map is unchanged.
#[derive(Debug, Error)]
pub enum FollowError {
    /// Malformed message.
    #[error(transparent)]
    Message(#[from] MapMessageError),
    /// Voxel count above the limit.
    #[error("the map has {found} voxels, more than {limit} (`max_voxels`)")]
    TooLarge {
        /// Number of voxels including the message.
        found: u64,
        /// The limit.
        limit: usize,
    },
}

/// Outcome of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// Applied, or stored until its keyframe is complete.
    Applied,
    /// Ignored: not newer than the current state, or of a map that is too large.
    Old,
    /// An earlier message is missing: request a keyframe.
    NeedKeyframe,
    /// A keyframe was left out: the node has to end.
    LeftOut,
}
