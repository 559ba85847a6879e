//! `semantic_icp_server`: registers labelled clouds of a headset with the robot's voxels.
//!
//! [`SemanticIcpServer`] is a state machine without I/O and heavy computation: expensive work is
//! a [`Job`] for another thread. [`node`] connects both to DDS.

mod counts;
mod diagnosis;
mod headset_scans;
mod intake;
mod jobs;
mod machine;
mod map;
pub mod node;
mod options;
mod output;
mod outputs;
mod parameters;
mod results;
mod search;
mod search_thread;
mod state;

pub use counts::{ServerCounts, ServerReport};
pub use options::{ByProfile, SearchWhen, ServerOptions, WhenBusy};
pub use output::{CallId, End, Output};
pub use parameters::declare;
pub use search::{Done, Job, LatticeSearch, MapCloud, Search, Work};
pub use state::SemanticIcpServer;
