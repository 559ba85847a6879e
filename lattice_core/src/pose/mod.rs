//! Poses on SE(3): buffers that interpolate and never extrapolate, axes of other systems.
//!
//! [`PoseBuffer`] holds where the machine was, [`TransformBuffer`] the tree of its frames.
//! Both answer exactly at their samples, by linear interpolation and slerp between them,
//! and with the reason where they cannot answer. Both are bounded in memory. [`Axes`] brings headsets and cameras to the axes of ROS.

mod axes;
mod buffer;
mod frame_name;
mod interpolate;
pub mod se3;
mod tf_error;
mod track;
mod transforms;

pub use axes::{Axes, UnknownAxes};
pub use buffer::{PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose};
pub use interpolate::interpolate;
pub use tf_error::{TfInsertError, TfMiss};
pub use transforms::{TransformBuffer, TransformBufferOptions};
