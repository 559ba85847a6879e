//! Reasons that a transform is refused or unavailable.

use thiserror::Error;

use super::pose_miss::seconds;

/// Reason that a transform is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum TfInsertError {
    /// Frame without a name.
    #[error("transform from '{child}' to '{parent}' has a frame without a name")]
    NoName { parent: String, child: String },
    /// Frame name that is too long.
    #[error("frame name has {bytes} bytes, over {max_bytes}")]
    LongName { bytes: usize, max_bytes: usize },
    /// Transform that is not finite or not a rotation.
    #[error(
        "transform of '{child}' in '{parent}' is not finite, or its quaternion not of length 1"
    )]
    NotFinite { parent: String, child: String },
    /// More frames than the limit, all of them in use.
    #[error(
        "transform of '{child}' in '{parent}' would exceed {max_frames} frames; raise the limit or find who publishes so many"
    )]
    TooManyFrames {
        parent: String,
        child: String,
        max_frames: usize,
    },
    /// Frame that is its own parent.
    #[error("transform of '{0}' in itself")]
    Itself(String),
}

/// Reason that a transform is unavailable.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum TfMiss {
    /// Unknown frame.
    #[error("unknown frame '{frame}': no transform of it was received on tf or tf_static")]
    UnknownFrame { frame: String },
    /// Frames in two trees.
    #[error(
        "no path from frame '{from}' to '{to}': a transform between their trees is not published"
    )]
    Disconnected { from: String, to: String },
    /// Time before the history of a frame on the path.
    #[error(
        "time is {:.6} s before the stored transforms of frame '{frame}'",
        seconds(by_ns)
    )]
    TooOld { frame: String, by_ns: i64 },
    /// Time after the newest transform of a frame on the path; a later one may cover it.
    #[error(
        "time is {:.6} s after the newest transform of frame '{frame}'",
        seconds(by_ns)
    )]
    TooNew { frame: String, by_ns: i64 },
    /// Gap between the transforms around the time.
    #[error(
        "transforms of frame '{frame}' are {:.6} s apart, over {:.6} s",
        seconds(gap_ns),
        seconds(max_gap_ns)
    )]
    Gap {
        frame: String,
        gap_ns: i64,
        max_gap_ns: i64,
    },
}

impl TfMiss {
    /// Tests whether a later transform may resolve the error: the time is only too new.
    pub fn may_still_come(&self) -> bool {
        matches!(self, TfMiss::TooNew { .. })
    }
}
