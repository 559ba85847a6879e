//! Nodes and endpoints of this process, for `ros2 node list` and `ros2 node info`.
//!
//! DDS has no node entity: each participant publishes its nodes with their readers and writers on
//! `ros_discovery_info` (rmw_dds_common).

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

use lattice_msgs::cdr;
use lattice_msgs::rmw_dds_common::{NodeEntitiesInfo, ParticipantEntitiesInfo};
use serde::ser::{Serialize, SerializeTuple, Serializer};
use smol::Timer;
use smol::channel::{Receiver, Sender, bounded};

use super::discovered_graph::GraphEndpoint;
use crate::config::names;
use crate::sync::lock;
use crate::transport::outbox::Outbox;
use crate::transport::port::{EndpointId, EndpointKind, PortNode, Transport};
use crate::transport::remote::GraphRole;

/// Delay between a change and its message.
const SETTLE_TIME: Duration = Duration::from_millis(50);

/// Longest wait at shutdown for readers of the last message.
const LEAVE_TIME: Duration = Duration::from_millis(500);

/// Index of a node in the graph.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeId(usize);

/// The nodes of this process.
pub(crate) struct Graph {
    nodes: Mutex<Vec<Entry>>,
    changed: Sender<()>,
    changes: Receiver<()>,
}

#[derive(Default)]
struct Entry {
    namespace: String,
    name: String,
    readers: Endpoints,
    writers: Endpoints,
}

/// Graph entry of each endpoint, by GUID.
type Endpoints = BTreeMap<EndpointId, Option<InGraph>>;

/// Role of an endpoint, and full name of its topic or service.
pub(crate) type InGraph = (GraphRole, String);

/// Warning for a second node of the same name in a process; begins as in rcl.
fn same_name(namespace: &str, name: &str) -> String {
    let node = names::fully_qualified(name, namespace);
    let logger = node.trim_start_matches('/').replace('/', ".");
    format!(
        "Publisher already registered for node name: '{name}'. If this is due to multiple nodes with the \
         same name then all logs for the logger named '{logger}' will go out over the existing publisher. \
         As soon as any node with that name is destructed it will unregister the publisher, preventing any \
         further logs for that name from being published on the rosout topic. Services and parameters of \
         {node} are now those of two nodes: rename one with `-r NODE:__node:=NAME`"
    )
}

/// Graph entry of an endpoint; dropping it removes the entry.
pub(crate) struct NodeEndpoint {
    graph: Arc<Graph>,
    node: NodeId,
    kind: EndpointKind,
    guid: EndpointId,
}

impl Graph {
    pub(crate) fn new() -> Arc<Self> {
        let (changed, changes) = bounded(1);
        Arc::new(Self {
            nodes: Mutex::default(),
            changed,
            changes,
        })
    }

    /// Adds a node until the process ends.
    pub(crate) fn add_node(&self, namespace: &str, name: &str) -> NodeId {
        let mut nodes = lock(&self.nodes);
        let id = NodeId(nodes.len());
        let mut others = nodes.iter();
        let twice = others.any(|node| (&*node.namespace, &*node.name) == (namespace, name));
        nodes.push(Entry {
            namespace: namespace.to_owned(),
            name: name.to_owned(),
            ..Entry::default()
        });
        drop(nodes);
        if twice {
            log::warn!("{}", same_name(namespace, name));
        }
        self.note_change();
        id
    }

    /// Namespace and name of a node.
    pub(crate) fn node(&self, id: NodeId) -> PortNode {
        let nodes = lock(&self.nodes);
        let node = nodes.get(id.0);
        let text = |of: fn(&Entry) -> &String| node.map(of).cloned().unwrap_or_default();
        PortNode {
            number: id.0,
            namespace: text(|node| &node.namespace),
            name: text(|node| &node.name),
        }
    }

    /// Adds an endpoint to a node.
    pub(crate) fn join(
        self: &Arc<Self>,
        node: NodeId,
        kind: EndpointKind,
        guid: EndpointId,
        of: Option<InGraph>,
    ) -> NodeEndpoint {
        self.edit(node, kind, |all| _ = all.insert(guid, of));
        NodeEndpoint {
            graph: Arc::clone(self),
            node,
            kind,
            guid,
        }
    }

    fn edit(&self, node: NodeId, kind: EndpointKind, change: impl FnOnce(&mut Endpoints)) {
        if let Some(entry) = lock(&self.nodes).get_mut(node.0) {
            change(match kind {
                EndpointKind::Reader => &mut entry.readers,
                EndpointKind::Writer => &mut entry.writers,
            });
        }
        self.note_change();
    }

    /// All endpoints of the nodes.
    pub(crate) fn all(&self) -> Vec<GraphEndpoint> {
        let mut all = Vec::new();
        for entry in lock(&self.nodes).iter() {
            let node = names::fully_qualified(&entry.name, &entry.namespace);
            let endpoints = entry.readers.values().chain(entry.writers.values());
            let in_graph = endpoints.flatten().cloned();
            all.extend(in_graph.map(|(role, name)| GraphEndpoint {
                role,
                name,
                node: node.clone(),
            }));
        }
        all
    }

    /// Requests publication of the graph.
    pub(crate) fn note_change(&self) {
        // One pending notification is enough.
        let _ = self.changed.try_send(());
    }

    /// Publishes an empty node list and waits for its readers. False: timeout before all have
    /// acknowledged. Not while [`Graph::publish`] runs.
    ///
    /// Fast DDS ignores the disposal of our participant and would list its nodes until the lease expires.
    pub(crate) fn leave(&self, participant: EndpointId, writer: &Outbox) -> bool {
        lock(&self.nodes).clear();
        let message = self.message(participant, gid_bytes());
        let queued = writer.send(Box::new(move || cdr::to_vec(&message)));
        queued.is_ok() && writer.flush(LEAVE_TIME)
    }

    fn message(&self, participant: EndpointId, gid_bytes: usize) -> ParticipantEntitiesInfo<Gid> {
        let gid = |id: EndpointId| Gid::new(id, gid_bytes);
        let gids = |all: &Endpoints| all.keys().copied().map(gid).collect();
        let node = |entry: &Entry| NodeEntitiesInfo {
            node_namespace: entry.namespace.clone(),
            node_name: entry.name.clone(),
            reader_gid_seq: gids(&entry.readers),
            writer_gid_seq: gids(&entry.writers),
        };
        ParticipantEntitiesInfo {
            gid: gid(participant),
            node_entities_info_seq: lock(&self.nodes).iter().map(node).collect(),
        }
    }

    /// Publishes the graph after every change, until the task is dropped.
    pub(crate) async fn publish(self: Arc<Self>, of: Weak<dyn Transport>, writer: Arc<Outbox>) {
        let gid_bytes = gid_bytes();
        while self.changes.recv().await.is_ok() {
            // Endpoints are created in bursts, and each message stays in the history for late joiners.
            Timer::after(SETTLE_TIME).await;
            let _ = self.changes.try_recv();
            let Some(of) = of.upgrade() else { return };
            let message = self.message(of.id(), gid_bytes);
            drop(of);
            if let Err(error) = writer.send(Box::new(move || cdr::to_vec(&message))) {
                log::debug!("{error}");
            }
            // Changes during the transmission are merged into one message.
            writer.flushed().await;
        }
    }
}

impl Drop for NodeEndpoint {
    fn drop(&mut self) {
        let remove = |all: &mut Endpoints| _ = all.remove(&self.guid);
        self.graph.edit(self.node, self.kind, remove);
    }
}

/// GID length on the wire, by `ROS_DISTRO`.
pub(crate) fn gid_bytes() -> usize {
    gid_bytes_of(std::env::var("ROS_DISTRO").ok().as_deref())
}

/// GID length of a distribution: 24 up to Humble, 16 since Iron.
fn gid_bytes_of(distro: Option<&str>) -> usize {
    match distro {
        Some("dashing" | "eloquent" | "foxy" | "galactic" | "humble") => 24,
        _ => 16,
    }
}

/// GUID of an endpoint, padded to the GID length of the distribution.
struct Gid {
    bytes: [u8; 24],
    length: usize,
}

impl Gid {
    fn new(guid: EndpointId, length: usize) -> Self {
        let bytes = std::array::from_fn(|i| guid.0.get(i).copied().unwrap_or(0));
        Self { bytes, length }
    }
}

impl Serialize for Gid {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut array = serializer.serialize_tuple(self.length)?;
        for byte in self.bytes.iter().take(self.length) {
            array.serialize_element(byte)?;
        }
        array.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wire_form_is_that_of_rmw_dds_common() {
        let guid = |byte| EndpointId([byte; 16]);
        let graph = Graph::new();
        let node = graph.add_node("/", "n");
        let of = |role, name: &str| Some((role, name.to_owned()));
        let (input, output) = (
            of(GraphRole::Subscriber, "/in"),
            of(GraphRole::Publisher, "/out"),
        );
        let reader = graph.join(node, EndpointKind::Reader, guid(2), input);
        let writer = graph.join(node, EndpointKind::Writer, guid(3), output);
        let all = graph.all().into_iter().map(|of| (of.name, of.node));
        let expected = ["/in", "/out"].map(|name| (name.to_owned(), "/n".to_owned()));
        assert!(all.eq(expected));
        let message = |gid_bytes| cdr::to_vec(&graph.message(guid(1), gid_bytes)).unwrap();
        let one = [1, 0, 0, 0];
        let slash = [2, 0, 0, 0, b'/', 0, 0, 0];
        let name = [2, 0, 0, 0, b'n', 0, 0, 0];
        let head = [&[0, 1, 0, 0][..], &[1; 16], &one, &slash, &name].concat();
        let expected = [&head[..], &one, &[2; 16], &one, &[3; 16]].concat();
        assert_eq!(message(16), expected);
        assert_eq!(message(24).len(), expected.len() + 3 * 8);
        drop((reader, writer));
        let entry = &lock(&graph.nodes)[0];
        assert!(entry.readers.is_empty() && entry.writers.is_empty());
    }

    #[test]
    fn humble_has_longer_gids() {
        let distros = [None, Some("humble"), Some("iron"), Some("jazzy")];
        assert_eq!(distros.map(gid_bytes_of), [16, 24, 16, 16]);
    }
}
