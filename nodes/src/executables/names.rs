//! Validation of parameter and node names before the nodes of a process start.
//!
//! | given | is rejected if |
//! |---|---|
//! | `-p NODE:NAME:=VALUE`, or NAME in a section of a file that names the node | the node does not know NAME |
//! | `-p NAME:=VALUE` | no node of the process knows NAME |
//! | NAME in a section with a wildcard (`/**`) | no node of Lattice has NAME; a warning if the file is shared |
//! | a section or rule of an unknown node | its name is a misspelling of a node of Lattice |
//! | a file | all its sections are of unknown nodes |
//! | sections of a node, all of other namespaces | always; a warning if the file is shared |
//!
//! Sections of other packages' nodes are ignored. Known names are defined by [`Params::unknown`].

use std::collections::{BTreeMap, BTreeSet};

use super::table::PARAMETERS;
use crate::start::{Declare, NodeError};
use lattice_runtime::params::{Addressed, Params, Unknown, addressed, is_near};
use lattice_runtime::params_file;
use lattice_runtime::ros_args::RosArgs;

/// Nodes of Lattice outside [`PARAMETERS`]: those of bags, and that of `lattice run` itself.
const OTHER_NODES: [&str; 3] = ["bag_player", "bag_recorder", "lattice"];

/// Scope of the parameter files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Files {
    /// The whole robot: `ros2 launch` passes one file to many nodes.
    Shared,
    /// This process, as in `lattice run`.
    Own,
}

/// A node by its default name, with the declaration of its parameters; `None`: only those of every node.
pub type NamedNode<'a> = (&'a str, Option<Declare>);

/// Rejects names unknown to the nodes of a process, and logs those that may belong to others.
pub fn check_names(args: &RosArgs, nodes: &[NamedNode<'_>], files: Files) -> Result<(), NodeError> {
    let addressed = addressed(args)?;
    let mut read = Vec::new();
    let mut all_read = true;
    for (name, declare) in nodes {
        let node = ReadNode {
            code_name: name,
            params: Params::of_node(args, name)?,
        };
        if let Some(Err(error)) = declare.map(|declare| declare(&node.params)) {
            // A managed node waits until the value is set.
            if !node.params.bool("managed", false)? {
                return Err(error.into());
            }
            all_read = false;
            continue;
        }
        read.push(node);
    }
    let names: Vec<String> = nodes.iter().map(|(name, _)| args.node_name(name)).collect();
    check_nodes(&addressed, &names, files)?;
    check_files(args, &names)?;
    for node in &read {
        node.check_namespace(&addressed, files)?;
        node.check_named()?;
    }
    match all_read {
        true => check_unnamed(&read, args, files),
        false => Ok(()),
    }
}

/// A node with declared parameters.
struct ReadNode<'a> {
    code_name: &'a str,
    params: Params,
}

impl ReadNode<'_> {
    /// Name without the leading slash.
    fn name(&self) -> &str {
        self.params.node().trim_start_matches('/')
    }

    fn help(&self) -> String {
        match self.code_name {
            "bag_recorder" => "`lattice record --help` has its options".to_owned(),
            name => format!("`lattice node {name} --help` lists its parameters"),
        }
    }

    /// Rejects parameters that address this node by name.
    fn check_named(&self) -> Result<(), NodeError> {
        for unknown in self.params.unknown().iter().filter(|of| of.named) {
            if unknown.is_of_others() {
                let (name, node) = (&unknown.name, self.name());
                log::warn!(
                    "parameter '{name}' of {node} has no effect: QoS is set by qos.TOPIC.reliability, \
                     .durability and .depth"
                );
                continue;
            }
            let nearest = self.params.nearest(&unknown.name);
            let nearest = nearest.as_ref().map(|(name, _)| &**name);
            return Err(unknown.error(self.name(), nearest, &self.help()).into());
        }
        Ok(())
    }

    /// Rejects sections of this node if none is for its namespace.
    fn check_namespace(
        &self,
        addressed: &BTreeSet<Addressed>,
        files: Files,
    ) -> Result<(), NodeError> {
        let fqn = self.params.node();
        let (namespace, name) = fqn.rsplit_once('/').unwrap_or(("", fqn));
        let in_code = format!("{namespace}/{}", self.code_name);
        let mut sections = addressed
            .iter()
            .filter(|of| of.node == name || of.node == self.code_name);
        let Some(first) = sections.clone().next() else {
            return Ok(());
        };
        if sections.any(|of| of.is_for(fqn) || of.is_for(&in_code)) {
            return Ok(());
        }
        let text = format!(
            "the section {} is not for {fqn}: start it with `-r __ns:=NAMESPACE`, or name the section \
             `/**/{name}`",
            first.place
        );
        match files {
            Files::Own => Err(text.into()),
            Files::Shared => {
                log::warn!("{text}");
                Ok(())
            }
        }
    }
}

/// Rejects misspelt node names; `names` are those of the process.
fn check_nodes(
    addressed: &BTreeSet<Addressed>,
    names: &[String],
    files: Files,
) -> Result<(), NodeError> {
    let ours = PARAMETERS.iter().map(|(name, _)| *name).chain(OTHER_NODES);
    let mut others = Vec::new();
    for Addressed { node, place, .. } in addressed {
        if names.contains(node) || ours.clone().any(|name| name == node) {
            continue;
        }
        if let Some(near) = ours.clone().find(|name| is_near(node, name)) {
            return Err(format!("{place} names an unknown node; did you mean '{near}'?").into());
        }
        others.push(place.as_str());
    }
    if files == Files::Own && !others.is_empty() {
        log::info!("not for nodes of Lattice: {}", others.join(", "));
    }
    Ok(())
}

/// Rejects files without a section for a node of Lattice.
fn check_files(args: &RosArgs, names: &[String]) -> Result<(), NodeError> {
    let ours = PARAMETERS.iter().map(|(name, _)| *name).chain(OTHER_NODES);
    let ours: BTreeSet<&str> = ours.chain(names.iter().map(String::as_str)).collect();
    for path in args.params_files() {
        let entries = params_file::read(path)?;
        let nodes: Option<BTreeSet<&str>> = entries.iter().map(|of| of.nodes.name()).collect();
        let Some(nodes) = nodes.filter(|nodes| !nodes.is_empty() && nodes.is_disjoint(&ours))
        else {
            continue;
        };
        let nodes = Vec::from_iter(nodes).join(", ");
        let (path, names) = (path.display(), names.join(", "));
        return Err(format!("{path} is for {nodes}, expected {names} or `/**`").into());
    }
    Ok(())
}

/// Rejects parameters for all nodes that no node knows.
fn check_unnamed(nodes: &[ReadNode<'_>], args: &RosArgs, files: Files) -> Result<(), NodeError> {
    let unknown: BTreeSet<Unknown> = nodes
        .iter()
        .flat_map(|node| node.params.unknown())
        .filter(|unknown| !unknown.named && !unknown.is_of_others())
        .collect();
    let known = |name: &str| nodes.iter().any(|node| node.params.has(name));
    let elsewhere = OfLattice::new(args);
    for unknown in unknown.iter().filter(|of| !known(&of.name)) {
        let in_file = unknown.place.is_some();
        if in_file && elsewhere.has(&unknown.name) {
            continue;
        }
        let error = error_of(unknown, nodes);
        match in_file && files == Files::Shared {
            true => log::warn!("{error}"),
            false => return Err(error),
        }
    }
    Ok(())
}

/// Error for an unknown parameter, with the node that has the most similar one.
fn error_of(unknown: &Unknown, nodes: &[ReadNode<'_>]) -> NodeError {
    let near = nodes.iter().filter_map(|node| {
        let (name, edits) = node.params.nearest(&unknown.name)?;
        Some((edits, node, name))
    });
    if let Some((_, node, name)) = near.min_by_key(|(edits, ..)| *edits) {
        return unknown.error(node.name(), Some(&name), "").into();
    }
    let of_nodes = nodes.iter().filter(|node| node.code_name != "lattice");
    let names: Vec<&str> = of_nodes.map(ReadNode::name).collect();
    let help = match nodes {
        [one] => one.help(),
        _ => "`lattice node NODE --help` lists the parameters of each".to_owned(),
    };
    unknown.error(&names.join(", "), None, &help).into()
}

/// Parameters of all nodes of Lattice, declared on demand.
struct OfLattice<'a> {
    args: &'a RosArgs,
    read: std::cell::OnceCell<BTreeMap<&'static str, Params>>,
}

impl<'a> OfLattice<'a> {
    fn new(args: &'a RosArgs) -> Self {
        Self {
            args,
            read: std::cell::OnceCell::new(),
        }
    }

    fn has(&self, name: &str) -> bool {
        let read = self.read.get_or_init(|| {
            let read = PARAMETERS.iter().filter_map(|(node, declare)| {
                let params = Params::of_node(self.args, node).ok()?;
                // Parameters declared before an invalid value count.
                let _ = declare(&params);
                Some((*node, params))
            });
            read.collect()
        });
        read.values().any(|params| params.has(name))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::executables::reader_of;

    /// Outcome of a check of nodes that are given a file and `-p` rules.
    fn checked(nodes: &[&str], files: Files, yaml: &str, rules: &[&str]) -> Result<(), String> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(yaml.as_bytes()).unwrap();
        let path = file.path().display().to_string();
        let mut line = vec!["--ros-args".to_owned(), "--params-file".to_owned(), path];
        for rule in rules {
            line.extend(["-p".to_owned(), (*rule).to_owned()]);
        }
        let args = RosArgs::parse(line).unwrap();
        let nodes: Vec<_> = nodes.iter().map(|name| (*name, reader_of(name))).collect();
        check_names(&args, &nodes, files).map_err(|error| error.to_string())
    }

    fn section(nodes: &str, param: &str) -> String {
        format!("{nodes}: {{ros__parameters: {{{param}}}}}\n")
    }

    const ONE: &[&str] = &["lattice_mapper"];
    const BOTH: &[&str] = &["lattice", "enu_transformer", "lattice_mapper"];

    #[test]
    fn unknown_parameters_are_refused_with_the_nearest_name() {
        let of_mapper =
            "parameter 'latice' of lattice_mapper is unknown; did you mean 'lattice'?".to_owned();
        for (nodes, files) in [(ONE, Files::Shared), (BOTH, Files::Own)] {
            for rule in ["latice:=bcc", "lattice_mapper:latice:=bcc"] {
                assert_eq!(checked(nodes, files, "", &[rule]), Err(of_mapper.clone()));
            }
            let in_file = section("/**/lattice_mapper", "latice: bcc");
            let error = checked(nodes, files, &in_file, &[]).unwrap_err();
            let place = "`/**/lattice_mapper.ros__parameters.latice`); did you mean 'lattice'?";
            assert!(error.ends_with(place), "{error}");
        }
        let error = checked(BOTH, Files::Own, "", &["resolution:=0.1"]).unwrap_err();
        assert_eq!(
            error,
            "parameter 'resolution' of enu_transformer, lattice_mapper is unknown; \
             `lattice node NODE --help` lists the parameters of each"
        );
    }

    #[test]
    fn a_parameter_of_one_node_may_be_given_to_all() {
        let rules = ["lattice:=bcc", "ins.source:=tf", "use_sim_time:=true"];
        assert_eq!(checked(BOTH, Files::Own, "", &rules), Ok(()));
        let error = checked(ONE, Files::Shared, "", &["ins.source:=tf"]).unwrap_err();
        assert!(error.contains("'ins.source' of lattice_mapper"), "{error}");
    }

    #[test]
    fn wildcards_may_hold_what_any_node_knows() {
        let known = section("/**", "ins: {source: tf}, lattice: bcc, use_sim_time: true");
        let overrides = section("/**", "qos_overrides: {/tf: {publisher: {depth: 7}}}");
        let unknown = section("/**", "robot_name: rex");
        for files in [Files::Shared, Files::Own] {
            assert_eq!(checked(ONE, files, &known, &[]), Ok(()));
            assert_eq!(checked(ONE, files, &overrides, &[]), Ok(()));
        }
        assert_eq!(checked(ONE, Files::Shared, &unknown, &[]), Ok(()));
        let error = checked(BOTH, Files::Own, &unknown, &[]).unwrap_err();
        assert!(
            error.contains("'robot_name'") && error.contains("/**"),
            "{error}"
        );
    }

    #[test]
    fn sections_of_misspelt_nodes_are_refused_and_those_of_others_are_not() {
        let others = [
            "amcl",
            "controller_server",
            "map_server",
            "lattice_mapper2",
            "/r/*/ekf_node",
        ];
        for files in [Files::Shared, Files::Own] {
            let foreign: String = others.iter().map(|of| section(of, "latice: 1")).collect();
            let error = checked(ONE, files, &foreign, &[]).unwrap_err();
            assert!(error.contains("is for amcl, "), "{error}");
            assert!(
                error.ends_with("expected lattice_mapper or `/**`"),
                "{error}"
            );
            for ours in ["/**", "enu_transformer", "/**/lattice_mapper"] {
                let all = foreign.clone() + &section(ours, "use_sim_time: true");
                assert_eq!(checked(ONE, files, &all, &[]), Ok(()), "{ours}");
            }
            let all = foreign;
            let wrong = section("/**/latice_mapper", "lattice: bcc");
            let error = checked(ONE, files, &(all + &wrong), &[]).unwrap_err();
            assert!(error.starts_with("`/**/latice_mapper` in /"), "{error}");
            assert!(error.ends_with("did you mean 'lattice_mapper'?"), "{error}");
            let error = checked(ONE, files, "", &["latice_mapper:lattice:=bcc"]).unwrap_err();
            assert!(error.contains("`-p latice_mapper:lattice`"), "{error}");
        }
    }

    #[test]
    fn sections_of_another_namespace_are_not_passed_over() {
        let elsewhere = section("/robot2/lattice_mapper", "lattice: bcc");
        let error = checked(BOTH, Files::Own, &elsewhere, &[]).unwrap_err();
        assert!(error.contains("`/robot2/lattice_mapper`"), "{error}");
        assert!(error.contains("`/**/lattice_mapper`"), "{error}");
        assert_eq!(checked(ONE, Files::Shared, &elsewhere, &[]), Ok(()));
        let both = elsewhere + &section("/**/lattice_mapper", "lattice: fcc");
        assert_eq!(checked(BOTH, Files::Own, &both, &[]), Ok(()));
    }

    #[test]
    fn wrong_values_are_refused_and_managed_nodes_wait_for_others() {
        let wrong = ["cell_volume_m3:=-1.0", "managed:=true"];
        let error = checked(ONE, Files::Shared, "", &wrong[..1]).unwrap_err();
        assert!(error.contains("cell_volume_m3"), "{error}");
        assert_eq!(checked(ONE, Files::Shared, "", &wrong), Ok(()));
    }
}
