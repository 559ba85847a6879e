//! From sensor clouds and an INS to clouds in the map frame (east, north, up).
//!
//! [`EnuTransformer`] is a state machine without I/O; [`node`] runs it behind DDS.

mod attitude;
mod body_mounts;
mod body_pose;
mod cloud_clocks;
mod cloud_notes;
mod cloud_times;
mod counts;
mod drops;
mod fixes;
mod imu_intake;
mod inertial;
pub mod ins;
mod ins_options;
mod ins_refusal;
mod link_orders;
mod machine;
pub mod node;
mod options;
mod parameters;
mod placing;
mod pose_frames;
mod pose_intake;
mod reference;
mod refusals;
#[cfg(feature = "bags")]
mod samples;
#[cfg(feature = "bags")]
mod sampling;
mod speed_gate;
mod stamp_order;
mod state;
mod tf_intake;
mod transforms;
mod verdict;
mod waiting;

pub use attitude::AttitudeReport;
pub use cloud_notes::CloudNote;
pub(crate) use cloud_notes::CloudNotes;
pub(crate) use cloud_times::CloudTimes;
pub use counts::{TransformerCounts, TransformerReport};
pub use options::TransformerOptions;
pub(crate) use options::time_options;
pub use parameters::declare;
pub use refusals::{Refusal, Refusals, most_frequent};
#[cfg(feature = "bags")]
pub use samples::{LogSamples, StatedMount};
#[cfg(feature = "bags")]
pub(crate) use stamp_order::StampOrder;
pub use state::{EnuOutput, EnuTransformer};
