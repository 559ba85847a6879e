//! The nodes of this process and their endpoints, for `ros2 node list` and `ros2 node info`.
//!
//! ROS 2 nodes are no DDS entities: every participant says on `ros_discovery_info` which nodes it
//! holds, with the readers and writers of each (rmw_dds_common).

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use lattice_msgs::cdr;
use serde::ser::{Serialize, SerializeTuple, Serializer};
use smol::Timer;
use smol::channel::{Receiver, Sender, bounded};

use super::outbox::Outbox;
use super::port::EndpointId;
use super::sync::lock;

/// DDS topic, not mangled.
pub(crate) const TOPIC: &str = "ros_discovery_info";

/// Its type.
pub(crate) const TYPE: &str = "rmw_dds_common/msg/ParticipantEntitiesInfo";

/// Time between a change and the message that names it.
const SETTLE_TIME: Duration = Duration::from_millis(50);

/// A node of this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct NodeId(u64);

/// Kind of an endpoint of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EndpointKind {
    Reader,
    Writer,
}

/// The nodes of this process.
pub(crate) struct Graph {
    nodes: Mutex<BTreeMap<NodeId, Entry>>,
    changed: Sender<()>,
    changes: Receiver<()>,
}

#[derive(Clone, Default)]
struct Entry {
    namespace: String,
    name: String,
    readers: BTreeSet<EndpointId>,
    writers: BTreeSet<EndpointId>,
}

/// An endpoint in the graph; dropping it takes it out.
pub(crate) struct NodeEndpoint {
    graph: Arc<Graph>,
    node: NodeId,
    kind: EndpointKind,
    guid: Option<EndpointId>,
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

    /// Adds a node; it stays until the process ends.
    pub(crate) fn add_node(&self, namespace: &str, name: &str) -> NodeId {
        let mut nodes = lock(&self.nodes);
        let id = NodeId(
            nodes
                .last_key_value()
                .map_or(0, |(id, _)| id.0.wrapping_add(1)),
        );
        nodes.insert(
            id,
            Entry {
                namespace: namespace.to_owned(),
                name: name.to_owned(),
                ..Entry::default()
            },
        );
        drop(nodes);
        self.note_change();
        id
    }

    /// Adds an endpoint to a node.
    pub(crate) fn join(
        self: &Arc<Self>,
        node: NodeId,
        kind: EndpointKind,
        guid: impl Into<Option<EndpointId>>,
    ) -> NodeEndpoint {
        let guid = guid.into();
        self.edit(node, kind, |set| {
            set.extend(guid);
        });
        NodeEndpoint {
            graph: Arc::clone(self),
            node,
            kind,
            guid,
        }
    }

    fn edit(
        &self,
        node: NodeId,
        kind: EndpointKind,
        change: impl FnOnce(&mut BTreeSet<EndpointId>),
    ) {
        if let Some(entry) = lock(&self.nodes).get_mut(&node) {
            change(match kind {
                EndpointKind::Reader => &mut entry.readers,
                EndpointKind::Writer => &mut entry.writers,
            });
        }
        self.note_change();
    }

    fn note_change(&self) {
        // One note that something has changed is enough.
        let _ = self.changed.try_send(());
    }

    /// Publishes the graph after every change, until the task is dropped.
    pub(crate) async fn publish(self: Arc<Self>, participant: EndpointId, writer: Arc<Outbox>) {
        let gid_bytes = gid_bytes(std::env::var("ROS_DISTRO").ok().as_deref());
        while self.changes.recv().await.is_ok() {
            // Endpoints come in bursts, and each message stays in the history for late joiners.
            Timer::after(SETTLE_TIME).await;
            let _ = self.changes.try_recv();
            let message = ParticipantEntitiesInfo {
                gid: Gid::new(participant, gid_bytes),
                nodes: lock(&self.nodes)
                    .values()
                    .map(|entry| NodeEntitiesInfo::new(entry, gid_bytes))
                    .collect(),
            };
            if let Err(error) = writer.send(Box::new(move || cdr::to_vec(&message))) {
                log::debug!("{error}");
            }
            // All changes while this goes out make one message.
            writer.flushed().await;
        }
    }
}

impl Drop for NodeEndpoint {
    fn drop(&mut self) {
        if let Some(guid) = self.guid {
            self.graph.edit(self.node, self.kind, |set| {
                set.remove(&guid);
            });
        }
    }
}

/// Bytes of a gid on the wire: 24 up to Humble, 16 since Iron.
fn gid_bytes(distro: Option<&str>) -> usize {
    match distro {
        Some("dashing" | "eloquent" | "foxy" | "galactic" | "humble") => 24,
        _ => 16,
    }
}

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`.
#[derive(serde::Serialize)]
struct ParticipantEntitiesInfo {
    gid: Gid,
    nodes: Vec<NodeEntitiesInfo>,
}

#[derive(serde::Serialize)]
struct NodeEntitiesInfo {
    namespace: String,
    name: String,
    readers: Vec<Gid>,
    writers: Vec<Gid>,
}

impl NodeEntitiesInfo {
    fn new(entry: &Entry, gid_bytes: usize) -> Self {
        let gids =
            |set: &BTreeSet<EndpointId>| set.iter().map(|g| Gid::new(*g, gid_bytes)).collect();
        Self {
            namespace: entry.namespace.clone(),
            name: entry.name.clone(),
            readers: gids(&entry.readers),
            writers: gids(&entry.writers),
        }
    }
}

/// Identity of an endpoint, padded to the length of the distribution.
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
        let reader = graph.join(node, EndpointKind::Reader, guid(2));
        let writer = graph.join(node, EndpointKind::Writer, guid(3));
        let entry = lock(&graph.nodes)[&node].clone();
        let message = |gid_bytes| ParticipantEntitiesInfo {
            gid: Gid::new(guid(1), gid_bytes),
            nodes: vec![NodeEntitiesInfo::new(&entry, gid_bytes)],
        };
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([1; 16]);
        expected.extend([
            1, 0, 0, 0, 2, 0, 0, 0, b'/', 0, 0, 0, 2, 0, 0, 0, b'n', 0, 0, 0,
        ]);
        expected.extend([1, 0, 0, 0]);
        expected.extend([2; 16]);
        expected.extend([1, 0, 0, 0]);
        expected.extend([3; 16]);
        assert_eq!(cdr::to_vec(&message(16)).unwrap(), expected);
        assert_eq!(
            cdr::to_vec(&message(24)).unwrap().len(),
            expected.len() + 3 * 8
        );
        drop((reader, writer));
        let entry = &lock(&graph.nodes)[&node];
        assert!(entry.readers.is_empty() && entry.writers.is_empty());
    }

    #[test]
    fn humble_has_longer_gids() {
        let cases = [
            (None, 16),
            (Some("humble"), 24),
            (Some("iron"), 16),
            (Some("jazzy"), 16),
        ];
        for (distro, bytes) in cases {
            assert_eq!(gid_bytes(distro), bytes, "{distro:?}");
        }
    }
}
