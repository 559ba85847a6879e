//! QoS, types, names and topics of the nodes.

use std::collections::{BTreeMap, BTreeSet};

use lattice_msgs::hash_of;
use lattice_runtime::GraphRole::{Publisher, Subscriber};

use super::super::facts::{Endpoint, Facts};
use super::Severity::{Error, Warn};
use super::{Finding, list};

pub fn findings(facts: &Facts) -> Vec<Finding> {
    let mut topics: BTreeMap<&str, Vec<&Endpoint>> = BTreeMap::new();
    for of in facts.endpoints.iter().filter(|of| of.type_name.is_some()) {
        topics.entry(&of.topic).or_default().push(of);
    }
    let mut found = Vec::new();
    for (topic, endpoints) in &topics {
        found.extend(types(topic, endpoints));
        if facts.network.is_dds() {
            found.extend(qos(topic, endpoints));
        }
    }
    found.extend(versions(facts));
    found.extend(names(facts));
    found.extend(unconnected(&topics));
    found
}

/// Two types on a topic.
fn types(topic: &str, endpoints: &[&Endpoint]) -> Option<Finding> {
    let mut nodes: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for of in endpoints {
        let type_name = of.type_name.as_deref().unwrap_or_default();
        nodes.entry(type_name).or_default().insert(&of.node);
    }
    let each = nodes
        .iter()
        .map(|(name, nodes)| format!("{name} ({})", list(nodes.iter().copied())));
    let last = topic.rsplit('/').next().unwrap_or_default();
    (nodes.len() > 1).then(|| {
        Finding::new(
            Error,
            "types",
            format!(
                "{topic} has {} types: {}",
                nodes.len(),
                each.collect::<Vec<_>>().join(", ")
            ),
            format!("remap one of them: --ros-args -r {topic}:=/NAMESPACE/{last}"),
        )
    })
}

/// A policy in which an offer is less than a request.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Policy {
    name: &'static str,
    parameter: &'static str,
    requested: &'static str,
    offered: &'static str,
}

const RELIABILITY: Policy = Policy {
    name: "RELIABILITY",
    parameter: "reliability",
    requested: "reliable",
    offered: "best_effort",
};
const DURABILITY: Policy = Policy {
    name: "DURABILITY",
    parameter: "durability",
    requested: "transient_local",
    offered: "volatile",
};

/// Policies of a publisher and a subscription that cannot match.
fn qos(topic: &str, endpoints: &[&Endpoint]) -> Vec<Finding> {
    let of = |role| endpoints.iter().copied().filter(move |of| of.role == role);
    let mut pairs: BTreeMap<Policy, [BTreeSet<&str>; 2]> = BTreeMap::new();
    for subscription in of(Subscriber) {
        for publisher in of(Publisher).filter(|of| of.type_name == subscription.type_name) {
            let policy = if subscription.is_reliable && !publisher.is_reliable {
                RELIABILITY
            } else if subscription.is_transient_local && !publisher.is_transient_local {
                DURABILITY
            } else {
                continue;
            };
            let [publishers, subscriptions] = pairs.entry(policy).or_default();
            publishers.insert(&publisher.node);
            subscriptions.insert(&subscription.node);
        }
    }
    let mut found = Vec::new();
    for (policy, [publishers, subscriptions]) in pairs {
        let Policy {
            name,
            parameter,
            requested,
            offered,
        } = policy;
        found.push(Finding::new(
            Error,
            "QoS",
            format!(
                "{topic}: {} requests {requested}, {} offers {offered} ({name}): no message passes",
                list(subscriptions),
                list(publishers)
            ),
            format!(
                "of a Lattice node: -p qos.{topic}.{parameter}:={offered} of the subscription, or :={requested} of the \
                 publisher; otherwise its own QoS"
            ),
        ));
    }
    found
}

/// Types whose definition is another one than here.
fn versions(facts: &Facts) -> Vec<Finding> {
    let mut nodes: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for of in &facts.endpoints {
        let (Some(name), Some(theirs)) = (&of.type_name, &of.type_hash) else {
            continue;
        };
        if hash_of(name).is_some_and(|ours| ours != theirs) {
            nodes.entry(name).or_default().insert(&of.node);
        }
    }
    let finding = |(name, nodes): (&str, BTreeSet<&str>)| {
        let (what, remedy) = match name.starts_with("lattice_msgs/") {
            true => (
                "another version of Lattice",
                "install the same version of Lattice on both sides (docs/compatibility.md)",
            ),
            false => (
                "another definition of the message",
                "use one ROS distribution, or build the message package of both sides from one source",
            ),
        };
        Finding::new(
            Error,
            "version",
            format!("{name} of {} has another type hash: {what}", list(nodes)),
            remedy,
        )
    };
    nodes.into_iter().map(finding).collect()
}

/// Two nodes of one name.
fn names(facts: &Facts) -> Vec<Finding> {
    let mut participants: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for of in facts.endpoints.iter().filter(|of| of.node.starts_with('/')) {
        if let Some(participant) = &of.participant {
            let of_node = participants.entry(&of.node).or_default();
            of_node.insert(participant);
        }
    }
    let twice = participants.into_iter().filter(|(_, of)| of.len() > 1);
    let finding = |(node, of): (&str, BTreeSet<&str>)| {
        Finding::new(
            Error,
            "names",
            format!(
                "{} nodes have the name {node}: parameters and services reach any of them",
                of.len()
            ),
            "end one of them, or rename it: --ros-args -r __node:=NAME or -r __ns:=/NAMESPACE",
        )
    };
    twice.map(finding).collect()
}

/// Subscriptions without a publisher while another topic of the type has no subscription.
fn unconnected(topics: &BTreeMap<&str, Vec<&Endpoint>>) -> Vec<Finding> {
    let lacks = |role| {
        let lacking = move |(_, of): &(&&str, &Vec<&Endpoint>)| of.iter().all(|of| of.role != role);
        topics.iter().filter(lacking)
    };
    let mut found = Vec::new();
    for (topic, endpoints) in lacks(Publisher) {
        let wanted = endpoints.first().and_then(|of| of.type_name.as_deref());
        let is_wanted = |(_, of): &(&&str, &Vec<&Endpoint>)| {
            let offered = of.first().and_then(|of| of.type_name.as_deref());
            let is_of_other = |of: &&Endpoint| !endpoints.iter().any(|ours| ours.node == of.node);
            offered == wanted && of.iter().any(is_of_other)
        };
        let Some((other, _)) = lacks(Subscriber).find(is_wanted) else {
            continue;
        };
        let nodes: BTreeSet<&str> = endpoints.iter().map(|of| of.node.as_str()).collect();
        found.push(Finding::new(
            Warn,
            "topics",
            format!(
                "{topic} of {} has no publisher; {other} of the same type ({}) has no subscription",
                list(nodes),
                wanted.unwrap_or_default()
            ),
            format!("remap: --ros-args -r {topic}:={other}, if that is its source"),
        ));
    }
    found
}
