//! `headset_cloud`: clouds for `semantic_icp_server` from the mesh of a headset and labels of its camera.
//!
//! [`HeadsetCloud`] is a state machine without I/O; [`node`] connects it to DDS.

mod chunks;
mod counts;
mod machine;
mod marker;
mod meshes;
pub mod node;
mod options;
mod parameters;
mod poses;
mod refusal;
mod session;
mod surfaces;
mod view;
mod waiting;

pub use counts::{HeadsetCounts, HeadsetReport, ViewCounts};
pub use machine::{HeadsetCloud, HeadsetOutput};
pub use options::{HeadsetOptions, LabelsFrom, PoseSource};
pub use parameters::declare;
pub use refusal::MeshRefusal;
pub use surfaces::MeshOptions;
pub use view::ViewOptions;
pub use waiting::HeadsetStream;
