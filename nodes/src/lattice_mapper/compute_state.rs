//! State of the node's compute thread.

use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex, Once};
use std::thread::JoinHandle;

use lattice_msgs::geographic_msgs::GeoPointStamped;
use lattice_runtime::logging::Throttle;
use lattice_runtime::{Activity, Diagnostics, Losses};

use super::autosave::Autosave;
use super::corrected::CorrectedDrive;
use super::map_folder::MapFolder;
use super::octomap::Octomaps;
use super::outputs::Outputs;
use super::state::LatticeMapper;
use super::unmapped::Unmapped;
use crate::map_output::MapOutput;

/// Warning for clouds without viewpoints while free space is on.
pub(super) const NO_VIEWPOINTS: &str = "no sensor positions (vp_x, vp_y, vp_z), so no free space: set `viewpoints: true` of enu_transformer";

/// Requests for the next update, kept independently of the inbox.
#[derive(Default)]
pub(super) struct UpdateRequests {
    pub centers: AtomicBool,
    pub origin: Mutex<Option<Arc<GeoPointStamped>>>,
}

/// State of the compute thread.
pub(super) struct ComputeState {
    pub activity: Activity,
    pub machine: LatticeMapper,
    /// Present if corrections are followed.
    pub drive: Option<CorrectedDrive>,
    pub autosave: Autosave,
    pub output: MapOutput,
    pub octomaps: Option<Octomaps>,
    pub outputs: Outputs,
    pub diagnostics: Diagnostics,
    /// Present until there is a map.
    pub unmapped: Option<Unmapped>,
    /// Clouds rejected by a full inbox.
    pub lost: Arc<AtomicU64>,
    /// Losses before the inbox: of clouds, and of all inputs.
    pub clouds: Losses,
    pub inputs: Losses,
    pub refusals: Throttle,
    pub no_viewpoints: Once,
    pub update_requests: Arc<UpdateRequests>,
    /// Thread that writes a map file.
    pub writing: Option<JoinHandle<()>>,
    /// Folder of map files.
    pub maps: MapFolder,
    /// State of the last published centres.
    pub centers_of: Option<(u64, u64)>,
    pub report_file: String,
}
