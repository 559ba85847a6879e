//! Nodes addressed by parameter files and the command line.

use std::collections::BTreeSet;

use super::ParamError;
use crate::config::params_file::{self, NodePattern};
use crate::config::ros_args::RosArgs;

/// Node addressed by a section of a file or by a rule `-p node:name:=value`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Addressed {
    /// Name of the node.
    pub node: String,
    /// Section or rule, with the file.
    pub place: String,
    /// Pattern of a section.
    pattern: Option<NodePattern>,
}

impl Addressed {
    /// True if it addresses the node of this full name.
    pub fn is_for(&self, node_fqn: &str) -> bool {
        self.pattern
            .as_ref()
            .is_none_or(|pattern| pattern.matches(node_fqn))
    }
}

/// All nodes addressed by the arguments, each place once.
pub fn addressed(args: &RosArgs) -> Result<BTreeSet<Addressed>, ParamError> {
    let mut found = BTreeSet::new();
    for path in &args.params_files {
        for entry in params_file::read(path)? {
            if let Some(node) = entry.nodes.name() {
                let section = entry.key.split(".ros__parameters").next();
                found.insert(Addressed {
                    node: node.to_owned(),
                    place: format!("`{}` in {}", section.unwrap_or_default(), path.display()),
                    pattern: Some(entry.nodes.clone()),
                });
            }
        }
    }
    for rule in &args.param_overrides {
        if let Some(node) = &rule.node {
            found.insert(Addressed {
                node: node.clone(),
                place: format!("`-p {node}:{}`", rule.name),
                pattern: None,
            });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_and_rules_name_nodes_and_wildcards_do_not() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        let text = "/**: {ros__parameters: {a: 1}}\n\
                    /**/latice_mapper: {ros__parameters: {a: 1, b: {c: 2}}}\n\
                    robot: {amcl: {ros__parameters: {a: 1}}}\n";
        std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
        let path = file.path().display().to_string();
        let line = [
            "--ros-args",
            "--params-file",
            &path,
            "-p",
            "view:port:=1",
            "-p",
            "x:=1",
        ];
        let args = RosArgs::parse(line.map(str::to_owned)).unwrap();
        let all = addressed(&args).unwrap();
        let nodes: Vec<_> = all.iter().map(|of| (&*of.node, &*of.place)).collect();
        let place = |section: &str| format!("`{section}` in {path}");
        let expected = [
            ("amcl", &*place("robot.amcl")),
            ("latice_mapper", &*place("/**/latice_mapper")),
            ("view", "`-p view:port`"),
        ];
        assert_eq!(nodes, expected);
        let amcl = all.first().unwrap();
        assert!(amcl.is_for("/robot/amcl") && !amcl.is_for("/amcl"));
    }
}
