//! Errors of an estimate against the truth.

mod pose_error;

pub use pose_error::PoseError;
