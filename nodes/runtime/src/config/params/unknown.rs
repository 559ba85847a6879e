//! Parameters that are given but unknown to the node.
//!
//! | name | is |
//! |---|---|
//! | read by the node | known |
//! | `use_sim_time` and the others of every node | known |
//! | `qos.TOPIC.reliability`, `.durability`, `.depth` | known if the node has the topic |
//! | `qos_overrides.*`, `diagnostic_updater.*` of rclcpp | foreign: without effect here |
//! | any other | unknown |

use super::about::OF_EVERY_NODE;
use super::error::ParamError;
use super::state::{Given, Origin, Params};
use crate::sync::lock;

/// Prefixes of names that rclcpp and its helpers declare in any node.
const OF_OTHERS: [&str; 2] = ["qos_overrides.", "diagnostic_updater."];

/// Longest name compared with others, bytes.
const MAX_COMPARED_BYTES: usize = 128;

/// A parameter that is given but unknown to the node.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Unknown {
    /// Name of the parameter.
    pub name: String,
    /// True if it addresses this node by name; false if it addresses all nodes of the file or the arguments.
    pub named: bool,
    /// Place in a file; `None`: the command line.
    pub place: Option<String>,
}

impl Unknown {
    /// True for a name of rclcpp, which has no effect here but is not a mistake.
    pub fn is_of_others(&self) -> bool {
        OF_OTHERS.iter().any(|of| self.name.starts_with(of))
    }

    /// Error for this parameter. `node` has no parameter of this name, `nearest` is a similar one.
    pub fn error(&self, node: &str, nearest: Option<&str>, help: &str) -> ParamError {
        ParamError::Unknown {
            name: self.name.clone(),
            node: node.to_owned(),
            origin: (self.place.as_ref()).map_or_else(String::new, |place| format!(" ({place})")),
            remedy: match nearest {
                Some(nearest) => format!("did you mean '{nearest}'?"),
                None => help.to_owned(),
            },
        }
    }
}

impl Params {
    /// Given parameters unknown to the node, after it has declared its own. Those of topics count as known:
    /// see [`Params::without_topic`].
    pub fn unknown(&self) -> Vec<Unknown> {
        self.undeclared(|name| !OF_EVERY_NODE.iter().any(|about| about.is_of(name)))
    }

    /// Given parameters `qos.TOPIC.*` of topics that the node does not have, after it has created its endpoints.
    pub fn without_topic(&self) -> Vec<Unknown> {
        let is_of = |name: &str| OF_EVERY_NODE.iter().any(|about| about.is_of(name));
        self.undeclared(|name| name.starts_with("qos.") && is_of(name))
    }

    fn undeclared(&self, wanted: impl Fn(&str) -> bool) -> Vec<Unknown> {
        let state = lock(&self.state);
        let given = state.given.iter();
        let found = given.filter(|(name, _)| !state.declared.contains_key(*name) && wanted(name));
        let unknown = |(name, given): (&String, &Given)| Unknown {
            name: name.clone(),
            named: given.named,
            place: match &given.origin {
                Origin::File { path, key } => Some(format!("{}, `{key}`", path.display())),
                Origin::Default | Origin::CommandLine | Origin::Service => None,
            },
        };
        found.map(unknown).collect()
    }

    /// Most similar parameter name of the node, with its edit distance.
    pub fn nearest(&self, name: &str) -> Option<(String, usize)> {
        let state = lock(&self.state);
        let plain = OF_EVERY_NODE.iter().map(|about| about.name);
        let known = state.declared.keys().map(String::as_str).chain(plain);
        let known = known.filter(|known| !known.starts_with('*'));
        let policies = ["reliability", "durability", "depth"];
        match name.rsplit_once('.') {
            Some((topic, policy)) if name.starts_with("qos.") && !policies.contains(&policy) => {
                let (policy, edits) = nearest(policy, policies)?;
                Some((format!("{topic}.{policy}"), edits))
            }
            _ => nearest(name, known).map(|(name, edits)| (name.to_owned(), edits)),
        }
    }
}

/// Most similar name with its edit distance: up to two, or up to a third of its letters if that is
/// more. A missing group (`source` for `ins.source`) counts as one edit.
pub fn nearest<'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<(&'a str, usize)> {
    if name.len() > MAX_COMPARED_BYTES {
        return None;
    }
    let most = (name.len() / 3).max(2);
    let edits = |known: &str| match known.rsplit_once('.') {
        Some((_, last)) if last == name => 1,
        _ => strsim::osa_distance(name, known),
    };
    let near = known.into_iter().map(|known| (known, edits(known)));
    let near = near.filter(|(_, edits)| *edits <= most);
    near.min_by_key(|(_, edits)| *edits)
}

/// True if `name` is a misspelling of the node name `known`: one edit, or two from 12 letters on. A name that
/// contains all of `known` (`lattice_mapper2`) is another node.
pub fn is_near(name: &str, known: &str) -> bool {
    let most = if known.len() < 12 { 1 } else { 2 };
    name != known
        && !name.contains(known)
        && name.len() <= MAX_COMPARED_BYTES
        && strsim::osa_distance(name, known) <= most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::params::ParamValue;

    fn given(names: &[&str]) -> Params {
        let values = names.iter().map(|name| (*name, ParamValue::I64(1)));
        let params = Params::from_values("/robot/mapper", values);
        params.string("lattice", "fcc").ok();
        params.string("ins.source", "tf").unwrap();
        params.f64("cell_volume_m3", 0.125).unwrap();
        params
    }

    #[test]
    fn names_of_every_node_and_of_topics_are_known() {
        let params = given(&["latice", "use_sim_time", "managed", "qos./map.depth"]);
        let unknown = params.unknown();
        let names: Vec<_> = unknown.iter().map(|unknown| &*unknown.name).collect();
        assert_eq!(names, ["latice"]);
        assert!(unknown[0].named && unknown[0].place.is_none());
        let topics = params.without_topic();
        assert_eq!(topics.len(), 1);
        assert_eq!(topics[0].name, "qos./map.depth");
        let of_rclcpp = given(&["qos_overrides./tf.publisher.depth"]).unknown();
        assert!(of_rclcpp[0].is_of_others() && !unknown[0].is_of_others());
    }

    #[test]
    fn the_nearest_name_is_offered() {
        let params = given(&[]);
        for (name, nearest) in [
            ("latice", Some("lattice")),
            ("latitce", Some("lattice")),
            ("cell_volume", Some("cell_volume_m3")),
            ("source", Some("ins.source")),
            ("ins.sorce", Some("ins.source")),
            ("use_simtime", Some("use_sim_time")),
            ("qos.map.reliabilty", Some("qos.map.reliability")),
            ("resolution", None),
            ("x", None),
            (&"latice".repeat(100), None),
        ] {
            let found = params.nearest(name);
            assert_eq!(found.as_ref().map(|(name, _)| &**name), nearest, "{name}");
        }
    }

    #[test]
    fn the_error_names_node_place_and_remedy() {
        let mut unknown = given(&["latice"]).unknown().remove(0);
        assert_eq!(
            unknown.error("mapper", Some("lattice"), "").to_string(),
            "parameter 'latice' of mapper is unknown; did you mean 'lattice'?"
        );
        unknown.place = Some("a.yaml, `/**.ros__parameters.latice`".to_owned());
        assert_eq!(
            unknown.error("mapper", None, "see --help").to_string(),
            "parameter 'latice' of mapper is unknown (a.yaml, `/**.ros__parameters.latice`); see --help"
        );
    }

    #[test]
    fn nodes_of_other_packages_are_no_misspellings() {
        let ours = [
            "enu_transformer",
            "lattice_mapper",
            "map_merger",
            "segmenter",
            "viewer_server",
            "bag_player",
        ];
        let near = |name: &str| ours.iter().any(|known| is_near(name, known));
        for name in [
            "latice_mapper",
            "lattice_maper",
            "enu_tranfsormer",
            "map_merge",
        ] {
            assert!(near(name), "{name}");
        }
        for name in [
            "map_server", // of Nav2
            "map_saver",
            "amcl",
            "controller_server",
            "planner_server",
            "behavior_server",
            "route_server",
            "velocity_smoother",
            "lattice_mapper",
            "lattice_mapper2",
            "front_lattice_mapper",
            "octomap_server",
            "ekf_filter_node",
        ] {
            assert!(!near(name), "{name}");
        }
    }
}
