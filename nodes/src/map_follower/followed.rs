//! Effects and errors of messages of the map.

use thiserror::Error;

use crate::convert::map::MapMessageError;

/// Error of a message of the map. The map is as it was before.
#[derive(Debug, Error)]
pub enum FollowError {
    /// Malformed.
    #[error(transparent)]
    Message(#[from] MapMessageError),
    /// More voxels than allowed.
    #[error("the map has {found} voxels, at most {limit} are kept (`max_voxels`)")]
    TooLarge {
        /// Voxels that there would be.
        found: u64,
        /// The limit.
        limit: usize,
    },
}

/// Effect of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// Applied, or kept until the rest of its keyframe has come.
    Applied,
    /// Of the state at hand or an older one, or of a map that is too large; ignored.
    Old,
    /// Something before it was lost or never received: ask for a keyframe.
    NeedKeyframe,
}
