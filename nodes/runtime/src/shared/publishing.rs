//! Publishers of the process.

use std::sync::{Arc, Mutex};

use lattice_msgs::RosMessage;

use super::Shared;
use crate::error::RuntimeError;
use crate::graph::{EndpointKind, NodeId};
use crate::local_bus::LocalEndpoint;
use crate::names;
use crate::outbox::WhenFull;
use crate::peers::Peers;
use crate::publisher::{Latch, Publisher, PublisherParts, RawPublisher};
use crate::qos::{Durability, Qos};
use crate::sync::lock;

impl Shared {
    pub(crate) fn publisher<M: RosMessage>(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        qos: &Qos,
    ) -> Result<Publisher<M>, RuntimeError> {
        let parts = self.publisher_parts(node, topic, M::TYPE, qos, WhenFull::Drop, |peers| {
            let topic = self.bus.topic(topic);
            topic.join_publisher::<M>(peers, latch_depth(qos))
        })?;
        Ok(Publisher::new(parts))
    }

    pub(crate) fn raw_publisher(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        type_name: &str,
        qos: &Qos,
    ) -> Result<RawPublisher, RuntimeError> {
        let parts = self.publisher_parts(node, topic, type_name, qos, WhenFull::Wait, |peers| {
            let topic = self.bus.topic(topic);
            topic.join_raw_publisher(type_name, peers, latch_depth(qos))
        })?;
        Ok(RawPublisher::new(parts))
    }

    fn publisher_parts(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        type_name: &str,
        qos: &Qos,
        when_full: WhenFull,
        join: impl FnOnce(&Arc<Peers>) -> Result<LocalEndpoint, RuntimeError>,
    ) -> Result<Arc<PublisherParts>, RuntimeError> {
        let peers = Arc::new(Peers::of_publisher(topic));
        let local = join(&peers)?;
        let writer = self.with_readers_closed(topic, || {
            self.outbox(topic, &names::dds_topic(topic), type_name, qos, when_full)
        })?;
        let id = writer.id();
        let parts = Arc::new(PublisherParts {
            writer,
            peers: Arc::clone(&peers),
            local,
            latch: (qos.durability == Durability::TransientLocal)
                .then(|| Mutex::new(Latch::new(latch_depth(qos)))),
            shutdown: self.shutdown.clone(),
            _graph: self.graph.join(node, EndpointKind::Writer, id),
        });
        if let Some(open) = lock(&self.open).as_mut() {
            open.publishers.retain(|p| p.strong_count() > 0);
            open.publishers.push(Arc::downgrade(&parts));
        }
        let joined = Arc::downgrade(&parts);
        peers.on_joined(Box::new(move || {
            if let Some(parts) = joined.upgrade() {
                parts.peer_joined();
            }
        }));
        self.endpoints.register(id, &peers);
        Ok(parts)
    }
}

fn latch_depth(qos: &Qos) -> usize {
    match qos.durability {
        Durability::TransientLocal => qos.depth.max(1),
        Durability::Volatile => 0,
    }
}
