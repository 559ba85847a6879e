//! Graph of nodes, topics and services in the protocol: a full message, then changes.

use std::collections::{BTreeMap, BTreeSet};

use lattice_runtime::{GraphEndpoint, GraphRole};

use crate::viewer_server::protocol::{GraphUpdate, connection_graph_update};

/// Limit of name bytes in a graph; further endpoints are omitted.
const MAX_BYTES: usize = 256 << 10;

/// Node names by topic or service name.
type Links = BTreeMap<String, BTreeSet<String>>;

/// Publishing, subscribing and serving nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConnectionGraph {
    published: Links,
    subscribed: Links,
    services: Links,
}

impl FromIterator<GraphEndpoint> for ConnectionGraph {
    fn from_iter<I: IntoIterator<Item = GraphEndpoint>>(endpoints: I) -> Self {
        let mut graph = Self::default();
        let mut bytes = 0;
        for GraphEndpoint { role, name, node } in endpoints {
            bytes += name.len() + node.len();
            if bytes > MAX_BYTES {
                break;
            }
            let links = match role {
                GraphRole::Publisher => &mut graph.published,
                GraphRole::Subscriber => &mut graph.subscribed,
                GraphRole::Server => &mut graph.services,
            };
            links.entry(name).or_default().insert(node);
        }
        graph
    }
}

impl ConnectionGraph {
    /// Message that updates `known` to this graph; `None` if they are equal.
    pub fn since(&self, known: &Self) -> Option<String> {
        (self != known).then(|| self.message(known))
    }

    /// Message of the whole graph.
    pub fn whole(&self) -> String {
        self.message(&Self::default())
    }

    fn message(&self, known: &Self) -> String {
        let is_topic =
            |name: &String| self.published.contains_key(name) || self.subscribed.contains_key(name);
        let topics = known.published.keys().chain(known.subscribed.keys());
        let removed: BTreeSet<&String> = topics.filter(|name| !is_topic(name)).collect();
        let services = known.services.keys();
        connection_graph_update(&GraphUpdate {
            published: changed(&self.published, &known.published, is_topic),
            subscribed: changed(&self.subscribed, &known.subscribed, is_topic),
            services: changed(&self.services, &known.services, |_| false),
            removed_topics: removed.into_iter().collect(),
            removed_services: services
                .filter(|name| !self.services.contains_key(*name))
                .collect(),
        })
    }
}

/// Names whose nodes differ from `known`, with their nodes: empty if the last one has left and the
/// name remains.
fn changed<'a>(
    now: &'a Links,
    known: &'a Links,
    stays: impl Fn(&String) -> bool,
) -> Vec<(&'a str, Vec<&'a str>)> {
    let nodes = |of: &'a BTreeSet<String>| of.iter().map(String::as_str).collect();
    let others = now.iter().filter(|(name, of)| known.get(*name) != Some(of));
    let others = others.map(|(name, of)| (name.as_str(), nodes(of)));
    let ended = known
        .keys()
        .filter(|name| !now.contains_key(*name) && stays(name));
    others
        .chain(ended.map(|name| (name.as_str(), Vec::new())))
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::*;
    use GraphRole::{Publisher, Server, Subscriber};

    fn graph(of: &[(GraphRole, &str, &str)]) -> ConnectionGraph {
        let endpoint = |(role, name, node): &(_, &str, &str)| GraphEndpoint {
            role: *role,
            name: (*name).to_owned(),
            node: (*node).to_owned(),
        };
        of.iter().map(endpoint).collect()
    }

    #[test]
    fn the_first_message_tells_all_and_the_next_what_has_changed() {
        let both = graph(&[
            (Publisher, "/map", "/mapper"),
            (Subscriber, "/map", "/viewer"),
            (Subscriber, "/points", "/mapper"),
            (Server, "/mapper/reset", "/mapper"),
        ]);
        let first: Value = serde_json::from_str(&both.whole()).unwrap();
        let expected = json!({
            "op": "connectionGraphUpdate",
            "publishedTopics": [{"name": "/map", "publisherIds": ["/mapper"]}],
            "subscribedTopics": [
                {"name": "/map", "subscriberIds": ["/viewer"]},
                {"name": "/points", "subscriberIds": ["/mapper"]},
            ],
            "advertisedServices": [{"name": "/mapper/reset", "providerIds": ["/mapper"]}],
            "removedTopics": [],
            "removedServices": [],
        });
        assert_eq!(first, expected);
        assert_eq!(both.since(&both), None);
        let one = graph(&[(Subscriber, "/map", "/viewer")]);
        let next: Value = serde_json::from_str(&one.since(&both).unwrap()).unwrap();
        let expected = json!({
            "op": "connectionGraphUpdate",
            "publishedTopics": [{"name": "/map", "publisherIds": []}],
            "subscribedTopics": [],
            "advertisedServices": [],
            "removedTopics": ["/points"],
            "removedServices": ["/mapper/reset"],
        });
        assert_eq!(next, expected);
    }

    #[test]
    fn names_beyond_what_is_sent_are_left_out() {
        let long = "n".repeat(MAX_BYTES / 3);
        let graph = graph(&["/a", "/b", "/c"].map(|name| (Publisher, name, &*long)));
        assert_eq!(graph.published.len(), 2);
    }

    /// Does to a graph as a client does that gets a message.
    fn apply(graph: &mut ConnectionGraph, text: &str) {
        let message: Value = serde_json::from_str(text).unwrap();
        let names = |field: &str| -> Vec<String> {
            serde_json::from_value(message[field].clone()).unwrap()
        };
        for (links, field, ids) in [
            (&mut graph.published, "publishedTopics", "publisherIds"),
            (&mut graph.subscribed, "subscribedTopics", "subscriberIds"),
            (&mut graph.services, "advertisedServices", "providerIds"),
        ] {
            for entry in message[field].as_array().unwrap() {
                let name = entry["name"].as_str().unwrap().to_owned();
                let nodes: BTreeSet<String> = serde_json::from_value(entry[ids].clone()).unwrap();
                links.insert(name, nodes);
            }
            links.retain(|_, nodes| !nodes.is_empty());
        }
        for name in names("removedTopics") {
            graph.published.remove(&name);
            graph.subscribed.remove(&name);
        }
        for name in names("removedServices") {
            graph.services.remove(&name);
        }
    }

    proptest! {
        #[test]
        fn clients_that_follow_know_the_graph(states in prop::collection::vec(
            prop::collection::vec((0..3usize, 0..4usize, 0..3usize), 0..12), 1..6)) {
            let mut known = ConnectionGraph::default();
            let mut client = ConnectionGraph::default();
            for state in states {
                let roles = [Publisher, Subscriber, Server];
                let state: Vec<_> = state.iter().map(|&(role, name, node)| {
                    (roles[role], ["/a", "/b", "/c", "/d"][name], ["/x", "/y", "/z"][node])
                }).collect();
                let now = graph(&state);
                if let Some(message) = now.since(&known) {
                    apply(&mut client, &message);
                }
                prop_assert_eq!(&client, &now);
                known = now;
            }
        }
    }
}
