//! Poses on SE(3): buffers that interpolate without extrapolation, and axis conventions.
//!
//! [`PoseBuffer`] holds the poses of the machine, [`TransformBuffer`] the tree of its frames. Both are exact at their
//! samples and interpolate between them (linear and slerp); else they return a reason. Their memory is bounded.
//! [`Axes`] converts from headsets and cameras to the axes of ROS.

mod attitude_check;
mod attitude_convention;
mod axes;
mod buffer;
mod frame_name;
mod inertial_axes;
mod inertial_check;
#[cfg(test)]
mod inertial_tests;
mod inertial_window;
mod interpolate;
mod pose_miss;
pub mod se3;
mod tf_error;
mod track;
mod transforms;

pub use attitude_check::{AttitudeCheck, AttitudeFinding};
pub use attitude_convention::AttitudeConvention;
pub use axes::{Axes, UnknownAxes};
pub use buffer::{PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose};
pub use inertial_check::{InertialCheck, InertialFinding};
pub use inertial_window::{InertialSample, InertialWindow, InertialWindows};
pub use interpolate::interpolate;
pub use tf_error::{TfInsertError, TfMiss};
pub use transforms::{TransformBuffer, TransformBufferOptions};
