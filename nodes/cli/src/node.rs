//! `lattice node`, and nodes by the name of the program.

use std::ffi::OsString;
use std::path::Path;

use clap::Args;
#[cfg(feature = "bags")]
use lattice_nodes::bag_player;
use lattice_nodes::executables;

use super::CliResult;

/// Run one node
#[derive(Args)]
#[command(disable_help_flag = true)]
pub struct NodeCommand {
    /// `segmenter`, `semantic_cloud`, `headset_cloud`, `lidar_odometry`, `enu_transformer`, `lattice_mapper`,
    /// `map_merger`, `map_projector`, `voxel_marker_publisher`, `semantic_icp_server`, `viewer_server` or `bag_player`
    name: String,
    /// As for any ROS node: `--ros-args -r from:=to -p name:=value --params-file FILE ...`
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl NodeCommand {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        run(&self.name, self.arguments)
    }
}

/// Names of all nodes of this build.
pub fn names() -> Vec<&'static str> {
    let composable = executables::NODES.iter().map(|(name, _)| *name);
    #[cfg(feature = "bags")]
    let composable = composable.chain([bag_player::NAME]);
    composable.collect()
}

/// The node, if the program was called by its name.
pub fn called_as(program: Option<OsString>) -> Option<String> {
    let program = program?;
    let name = Path::new(&program).file_stem()?.to_str()?;
    names().contains(&name).then(|| name.to_owned())
}

/// Runs a node until it is stopped, with `arguments` of the command line.
pub fn run(name: &str, arguments: impl IntoIterator<Item = String>) -> CliResult {
    #[cfg(feature = "bags")]
    if name == bag_player::NAME {
        return bag_player::run(arguments);
    }
    let start = executables::find(name)
        .ok_or_else(|| format!("no node '{name}', expected one of {}", names().join(", ")))?;
    executables::run(name, start, arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_by_the_name_of_a_node_is_that_node() {
        let called = |program: &str| called_as(Some(program.into()));
        assert_eq!(
            called("/opt/ros/lib/lattice_nodes/lattice_mapper").as_deref(),
            Some("lattice_mapper")
        );
        assert_eq!(called("./bag_player").is_some(), cfg!(feature = "bags"));
        assert_eq!(called("target/release/lattice"), None);
        assert_eq!(called("lattice_mapper_2"), None);
        assert_eq!(called_as(None), None);
    }
}
