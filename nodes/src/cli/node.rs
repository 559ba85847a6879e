//! `lattice node`: one node, as its own executable runs it.

use clap::Args;

use super::CliResult;
use crate::{bag_player, node};

/// Run one node
#[derive(Args)]
#[command(disable_help_flag = true)]
pub struct NodeCommand {
    /// `enu_transformer`, `lattice_mapper`, `voxel_marker_publisher`, `semantic_icp_server` or
    /// `bag_player`
    name: String,
    /// As for any ROS node: `--ros-args -r from:=to -p name:=value --params-file FILE ...`
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl NodeCommand {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        if self.name == bag_player::NAME {
            return bag_player::run(self.arguments);
        }
        let start = node::find(&self.name).ok_or_else(|| {
            let names: Vec<&str> = node::NODES.iter().map(|(name, _)| *name).collect();
            format!(
                "no node '{}', expected {} or {}",
                self.name,
                names.join(", "),
                bag_player::NAME
            )
        })?;
        node::run(&self.name, start, self.arguments)
    }
}
