//! `lattice map save`: the map of a running mapper, written by its service.

use std::time::Duration;

use clap::Args;
use lattice_msgs::cdr;
use lattice_msgs::lattice::{SaveMap, SaveMapRequest, SaveMapResponse};
use lattice_runtime::Runtime;
use lattice_runtime::ros_args::RosArgs;

use crate::CliResult;

/// Name of the calling node.
const NAME: &str = "lattice_map_save";

/// Have a running mapper write its map, by its service `save_map`
///
/// The file is on the machine of the mapper, with labels and free space as the mapper has them.
#[derive(Args)]
pub struct Save {
    /// Full name of a mapper or merger, such as /lattice_mapper or /robot/lattice_mapper
    #[arg(long, value_name = "NODE")]
    from: String,
    /// Name of the file below `map_dir` of the mapper; a map that is there is replaced
    file: String,
    /// Timeout, s
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    timeout: f64,
    /// As for any ROS node
    #[arg(last = true)]
    ros_args: Vec<String>,
}

impl Save {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let patience = Duration::try_from_secs_f64(self.timeout);
        let patience = patience.map_err(|error| format!("--timeout: {error}"))?;
        let quiet = ["--ros-args", "--disable-rosout-logs"].map(str::to_owned);
        let args = RosArgs::parse(self.ros_args.iter().cloned().chain(quiet))?;
        let runtime = Runtime::start(NAME, args)?;
        let node = runtime.node(NAME)?;
        let mapper = self.from.trim_matches('/');
        let client = node.client::<SaveMap>(&format!("/{mapper}/save_map"))?;
        let request = cdr::to_vec(&SaveMapRequest {
            path: self.file.clone(),
        })?;
        let reply = client.call_blocking(request, patience).map_err(|error| {
            format!("{error} (--from names a running node with save_map, on this ROS_DOMAIN_ID)")
        })?;
        let SaveMapResponse {
            success,
            message,
            voxels,
        } = cdr::from_slice(&reply)?;
        if !success {
            return Err(format!("/{mapper}: {message}").into());
        }
        println!("{voxels} voxels: {message}");
        Ok(())
    }
}
