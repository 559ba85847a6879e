//! Transforms that are refused, and reasons for which there is none.

use thiserror::Error;

use super::buffer::seconds;

/// A transform that is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum TfInsertError {
    /// A frame has no name.
    #[error("transform from '{child}' to '{parent}' has a frame without a name")]
    NoName { parent: String, child: String },
    /// A name is too long to be one.
    #[error("frame name has {bytes} bytes, over {max_bytes}")]
    LongName { bytes: usize, max_bytes: usize },
    /// A number is NaN or infinite, or the rotation is none.
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
    /// A frame is given as its own parent.
    #[error("transform of '{0}' in itself")]
    Itself(String),
}

/// A transform that is not available.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum TfMiss {
    /// No transform ever named the frame.
    #[error("frame '{frame}' is not known: nobody published it on tf or tf_static")]
    UnknownFrame { frame: String },
    /// The frames are in two trees.
    #[error(
        "no path from frame '{from}' to '{to}': a transform between their trees is not published"
    )]
    Disconnected { from: String, to: String },
    /// The time is before what is kept of a frame on the path.
    #[error(
        "time is {:.6} s before what is kept of frame '{frame}'",
        seconds(by_ns)
    )]
    TooOld { frame: String, by_ns: i64 },
    /// The time is after what came of a frame on the path: it may still come.
    #[error(
        "time is {:.6} s after the newest transform of frame '{frame}'",
        seconds(by_ns)
    )]
    TooNew { frame: String, by_ns: i64 },
    /// The transforms around the time are too far apart.
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
    /// True if waiting for the next transforms may help: the time is only too new.
    pub fn may_still_come(&self) -> bool {
        matches!(self, TfMiss::TooNew { .. })
    }
}
