//! How far an estimate is from the truth.

mod pose_error;

pub use pose_error::PoseError;
