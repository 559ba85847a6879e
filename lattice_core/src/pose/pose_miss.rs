//! Reasons for a missing pose.

use thiserror::Error;

/// Reason that a pose is unavailable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PoseMiss {
    /// No pose was received.
    #[error("no pose came yet")]
    Empty,
    /// Time before the oldest kept pose.
    #[error("time is {:.6} s before the oldest pose kept", seconds(by_ns))]
    BeforeStart { by_ns: i64 },
    /// Time after the newest pose; a later pose may cover it.
    #[error("time is {:.6} s after the newest pose", seconds(by_ns))]
    AfterEnd { by_ns: i64 },
    /// Gap between the poses around the time.
    #[error(
        "poses around the time are {:.6} s apart, over {:.6} s",
        seconds(gap_ns),
        seconds(max_gap_ns)
    )]
    Gap { gap_ns: i64, max_gap_ns: i64 },
}

pub(super) fn seconds(ns: &i64) -> f64 {
    *ns as f64 * 1.0e-9
}
