//! Parameters of the nodes of a replay.

use std::collections::BTreeSet;

use lattice_nodes::bag_player;
use lattice_nodes::executables::{self, Files, NamedNode};
use lattice_nodes::start::Declare;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;

use super::Replay;
use crate::CliResult;

/// Node that makes clouds of depth images.
pub(super) const CAMERA_NODE: &str = "semantic_cloud";

impl Replay {
    /// Rejects names unknown to the nodes of any replay.
    pub fn check_names(&self) -> CliResult {
        executables::check_names(&self.args()?, &self.nodes(), Files::Own)
    }

    /// Rejects names unknown to the nodes of a replay without depth images.
    pub(super) fn check_names_of_clouds(&self) -> CliResult {
        let mut nodes = self.nodes();
        nodes.retain(|(name, _)| *name != CAMERA_NODE);
        executables::check_names(&self.args()?, &nodes, Files::Own)
    }

    /// Nodes of the replay, with the declarations of their parameters.
    fn nodes(&self) -> Vec<NamedNode<'static>> {
        let mut names = vec![
            "enu_transformer",
            "lattice_mapper",
            "voxel_marker_publisher",
        ];
        names.push(CAMERA_NODE);
        names.extend(self.viewer.map(|_| "viewer_server"));
        let nodes = names.into_iter();
        let nodes = nodes.map(|name| (name, executables::reader_of(name)));
        let player = (bag_player::NAME, Some(bag_player::declare as Declare));
        nodes.chain((!self.direct).then_some(player)).collect()
    }

    fn args(&self) -> CliResult<RosArgs> {
        let mut arguments = vec!["--ros-args".to_owned()];
        for file in &self.params {
            arguments.extend(["--params-file".to_owned(), file.display().to_string()]);
        }
        for param in &self.param {
            arguments.extend(["-p".to_owned(), param.clone()]);
        }
        Ok(RosArgs::parse(arguments)?)
    }

    /// True if a network labels the colour images.
    pub(super) fn has_network(&self) -> CliResult<bool> {
        let model = self.params_of(CAMERA_NODE)?.string("model", "")?;
        Ok(!model.is_empty())
    }

    /// Parameters of a node.
    pub(super) fn params_of(&self, node: &str) -> CliResult<Params> {
        Ok(Params::of_node(&self.args()?, node)?)
    }

    /// Command line parameters for a process of these nodes: a node rejects unknown
    /// ones.
    pub(super) fn params_for(&self, nodes: &[&str]) -> CliResult<Vec<String>> {
        let mut unknown: Option<BTreeSet<String>> = None;
        for (node, declare) in self.nodes() {
            if let Some(declare) = declare.filter(|_| nodes.contains(&node)) {
                let params = self.params_of(node)?;
                declare(&params)?;
                let of_node = params.unknown().into_iter().map(|unknown| unknown.name);
                let of_node: BTreeSet<String> = of_node.collect();
                unknown = Some(unknown.map_or(of_node.clone(), |all| &all & &of_node));
            }
        }
        let unknown = unknown.unwrap_or_default();
        let name = |param: &str| {
            let (rule, _) = param.split_once(":=").unwrap_or((param, ""));
            rule.rsplit(':').next().unwrap_or(rule).to_owned()
        };
        let taken = self
            .param
            .iter()
            .filter(|param| !unknown.contains(&name(param)));
        Ok(taken.cloned().collect())
    }
}
