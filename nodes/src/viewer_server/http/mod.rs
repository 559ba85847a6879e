//! The part of HTTP that a page of fixed files and one WebSocket need, without I/O.

mod files;
mod gate;
mod head;

pub use gate::{Decision, Gate, Response};
pub use head::{Head, HeadError, MAX_HEAD_BYTES};
