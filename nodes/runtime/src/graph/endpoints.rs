//! Endpoints of this process by GUID, each with its matched peers.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, Weak};

use futures::StreamExt;
use futures::stream::BoxStream;

use super::discovered_graph::DiscoveredGraph;
use super::output_types::OutputTypes;
use super::type_versions::TypeVersions;
use crate::activity::Activity;
use crate::sync::lock;
use crate::transport::peers::Peers;
use crate::transport::port::{EndpointId, PortEvent};
use crate::transport::remote::{Announced, GraphRole, RemotePublisher};

/// Limit of stored events for endpoints that are not registered yet.
const MAX_EARLY_EVENTS: usize = 1024;

/// Limit of stored remote publishers.
const MAX_REMOTES: usize = 8192;

/// Peers of all local endpoints, and all remote publishers.
#[derive(Default)]
pub(crate) struct Endpoints {
    pub remotes: Remotes,
    pub discovered_graph: DiscoveredGraph,
    outputs: OutputTypes,
    versions: TypeVersions,
    inner: Mutex<Inner>,
    activity: Activity,
}

#[derive(Default)]
struct Inner {
    peers: BTreeMap<EndpointId, Weak<Peers>>,
    early: VecDeque<(EndpointId, Change)>,
}

struct Change {
    peer: EndpointId,
    /// Incompatible policy of the peer; `None`: it matches.
    incompatible: Option<Cow<'static, str>>,
}

impl Endpoints {
    /// None yet; each event of discovery is noted.
    pub(crate) fn new(activity: Activity) -> Self {
        Self {
            activity,
            ..Self::default()
        }
    }

    /// Passes all past and future events of the endpoint to `peers`.
    pub(crate) fn register(&self, endpoint: EndpointId, peers: &Arc<Peers>) {
        let mut inner = lock(&self.inner);
        inner.peers.retain(|_, peers| peers.strong_count() > 0);
        inner.peers.insert(endpoint, Arc::downgrade(peers));
        let early = std::mem::take(&mut inner.early);
        let (mine, others): (VecDeque<_>, _) =
            early.into_iter().partition(|(id, _)| *id == endpoint);
        inner.early = others;
        drop(inner);
        for (_, change) in mine {
            apply(peers, change);
        }
    }

    /// Warns once if another process publishes another type on the topic of this publisher, now or later.
    pub(crate) fn watch_type(&self, peers: &Arc<Peers>, type_name: &str) {
        self.outputs.add(peers, type_name, &self.remotes.all());
    }

    /// Dispatches events until the task is dropped.
    pub(crate) async fn watch(self: Arc<Self>, mut events: BoxStream<'static, PortEvent>) {
        while let Some(event) = events.next().await {
            self.hear(event);
            self.activity.note();
        }
    }

    fn hear(&self, event: PortEvent) {
        let (endpoint, peer, incompatible) = match event {
            PortEvent::Matched { endpoint, peer } => (endpoint, peer, None),
            PortEvent::Incompatible {
                endpoint,
                peer,
                policy,
            } => (endpoint, peer, Some(policy)),
            PortEvent::Found {
                peer,
                publisher,
                node,
            } => {
                let (role, topic) = (GraphRole::Publisher, &publisher.topic);
                let announced = Announced::from(&*publisher);
                self.warn_of_version(topic, &announced, node.as_deref());
                let (of, announced) = ((role, topic.as_str()), Some(announced));
                self.discovered_graph.add(peer, of, announced, node);
                // Added first, so that an output created meanwhile finds it.
                self.remotes.add(peer, (*publisher).clone());
                for line in self.outputs.on_found(&publisher) {
                    log::warn!("{line}");
                }
                return;
            }
            PortEvent::FoundOther {
                peer,
                role,
                name,
                announced,
                node,
            } => {
                let announced = announced.map(|announced| *announced);
                if let Some(announced) = &announced {
                    self.warn_of_version(&name, announced, node.as_deref());
                }
                return (self.discovered_graph).add(peer, (role, &name), announced, node);
            }
            PortEvent::Lost { peer: lost } => return self.lost(|peer| *peer == lost),
        };
        let change = Change { peer, incompatible };
        let mut inner = lock(&self.inner);
        let Some(peers) = inner.peers.get(&endpoint) else {
            if inner.early.len() >= MAX_EARLY_EVENTS {
                inner.early.pop_front();
            }
            inner.early.push_back((endpoint, change));
            return;
        };
        let peers = peers.upgrade();
        drop(inner);
        if let Some(peers) = peers {
            apply(&peers, change);
        }
    }

    fn warn_of_version(&self, topic: &str, announced: &Announced, node: Option<&str>) {
        if let Some(line) = self.versions.on_found(topic, announced, node) {
            log::warn!("{line}");
        }
    }

    fn lost(&self, gone: impl Fn(&EndpointId) -> bool) {
        self.remotes.remove(&gone);
        self.discovered_graph.remove(&gone);
        let mut inner = lock(&self.inner);
        inner.early.retain(|(_, change)| !gone(&change.peer));
        let all: Vec<Arc<Peers>> = inner.peers.values().filter_map(Weak::upgrade).collect();
        drop(inner);
        for peers in all {
            peers.remove(&gone);
        }
    }
}

fn apply(peers: &Peers, change: Change) {
    match change.incompatible {
        None => peers.add(change.peer),
        Some(policy) => peers.incompatible(change.peer, &policy),
    }
}

/// All known publishers of other processes.
#[derive(Default)]
pub(crate) struct Remotes(Mutex<BTreeMap<EndpointId, RemotePublisher>>);

impl Remotes {
    /// Adds or updates a publisher.
    pub(crate) fn add(&self, id: EndpointId, publisher: RemotePublisher) {
        let mut all = lock(&self.0);
        if all.len() < MAX_REMOTES || all.contains_key(&id) {
            all.insert(id, publisher);
        }
    }

    /// Removes publishers.
    pub(crate) fn remove(&self, gone: impl Fn(&EndpointId) -> bool) {
        lock(&self.0).retain(|id, _| !gone(id));
    }

    /// All known publishers, in arbitrary order.
    pub(crate) fn all(&self) -> Vec<RemotePublisher> {
        lock(&self.0).values().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::qos::Qos;

    #[test]
    fn events_before_registration_are_kept_until_the_peer_goes() {
        let endpoints = Endpoints::default();
        let [endpoint, peer, other] = [1, 2, 3].map(|byte| EndpointId([byte; 16]));
        for peer in [peer, other] {
            endpoints.hear(PortEvent::Matched { endpoint, peer });
        }
        endpoints.hear(PortEvent::Lost { peer: other });
        let peers = Arc::new(Peers::new("/map", "subscriber", log::Level::Info));
        endpoints.register(endpoint, &peers);
        assert_eq!(peers.count(), 1);
        endpoints.hear(PortEvent::Lost { peer });
        assert_eq!(peers.count(), 0);
    }

    #[test]
    fn publishers_come_and_go() {
        let remotes = Remotes::default();
        let ids = [1, 2].map(|byte| EndpointId([byte; 16]));
        let (name, offered) = (("rt/a", "a::msg::dds_::B_"), Qos::DEFAULT);
        let offered = (offered.reliability, offered.durability);
        let publisher = RemotePublisher::of(name, b"", offered).unwrap();
        for id in ids {
            remotes.add(id, publisher.clone());
        }
        remotes.add(ids[0], publisher);
        assert_eq!(remotes.all().len(), 2);
        remotes.remove(|id| *id == ids[0]);
        assert_eq!(remotes.all().len(), 1);
    }
}
