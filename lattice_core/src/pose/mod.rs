//! Poses on SE(3): buffers that interpolate and never extrapolate.
//!
//! [`PoseBuffer`] holds where the machine was, [`TransformBuffer`] the tree of its frames.
//! Both answer exactly at their samples, by linear interpolation and slerp between them,
//! and with the reason where they cannot answer. Both are bounded in memory.

mod buffer;
mod frame_name;
mod interpolate;
pub mod se3;
mod tf_error;
mod track;
mod transforms;

pub use buffer::{PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose};
pub use interpolate::interpolate;
pub use tf_error::{TfInsertError, TfMiss};
pub use transforms::{TransformBuffer, TransformBufferOptions};
