//! Direct replay: a log through the state machines of the nodes, in one process, without DDS.
//!
//! Messages pass in the order of the log, so the map depends on nothing else.

mod camera_input;
mod camera_report;
mod cameras;
mod depth_clouds;
mod disorder;
mod images;
mod mount_samples;
mod packets;
mod pipeline;
mod plan;
mod poses;
mod report;
mod scan_poses;
mod slice;
mod statics;
mod survey;
mod topic_plan;
mod topics;

pub use camera_input::CameraInput;
pub use camera_report::CameraReport;
pub use cameras::{CameraWishes, DepthCamera};
pub use depth_clouds::{DepthClouds, QUEUE_SIZE};
pub use mount_samples::{SampleError, mount_samples};
pub use pipeline::{Pipeline, run};
pub use plan::plan;
pub use report::{LatticeReport, RunReport};
pub use scan_poses::{OdometryInput, ScanPosesReport, feed_odometry};
pub use slice::Slice;
pub use topic_plan::{TopicPlan, TopicWishes};
pub use topics::{Role, TopicError};
