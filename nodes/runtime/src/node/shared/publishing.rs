//! Publishers of the process.

use std::marker::PhantomData;
use std::sync::{Arc, Mutex};

use lattice_msgs::{RosMessage, know_message};

use super::Shared;
use crate::communication::publisher::{Latch, Publisher, PublisherParts, RawPublisher};
use crate::error::RuntimeError;
use crate::graph::local_graph::NodeId;
use crate::sync::lock;
use crate::transport::local_bus::LocalEndpoint;
use crate::transport::outbox::WhenFull;
use crate::transport::peers::Peers;
use crate::transport::port::{EndpointKind, PortTopic};
use crate::transport::qos::Qos;
use crate::transport::remote::GraphRole;

impl Shared {
    pub(crate) fn publisher<M: RosMessage>(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        qos: &Qos,
        when_full: WhenFull,
    ) -> Result<Publisher<M>, RuntimeError> {
        know_message::<M>();
        let of = (M::TYPE, None);
        let parts = self.publisher_parts(node, topic, of, qos, when_full, |peers| {
            let topic = self.bus.topic(topic);
            topic.join_publisher::<M>(peers, qos.kept())
        })?;
        Ok(Publisher {
            parts,
            gate: None,
            message: PhantomData,
        })
    }

    pub(crate) fn raw_publisher(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        type_name: &str,
        type_hash: Option<&str>,
        qos: &Qos,
    ) -> Result<RawPublisher, RuntimeError> {
        let of = (type_name, type_hash);
        let parts = self.publisher_parts(node, topic, of, qos, WhenFull::Wait, |peers| {
            let topic = self.bus.topic(topic);
            topic.join_raw_publisher(type_name, peers, qos.kept())
        })?;
        Ok(RawPublisher { parts })
    }

    fn publisher_parts(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
        (ros_type, type_hash): (&str, Option<&str>),
        qos: &Qos,
        when_full: WhenFull,
        join: impl FnOnce(&Arc<Peers>) -> Result<LocalEndpoint, RuntimeError>,
    ) -> Result<Arc<PublisherParts>, RuntimeError> {
        let peers = Arc::new(Peers::new(topic, "subscriber", log::Level::Info));
        let local = join(&peers)?;
        let port_topic = PortTopic {
            node: &self.graph.node(node),
            name: topic,
            ros_type,
            type_hash,
        };
        let writer = self.outbox(port_topic, qos, when_full)?;
        let id = writer.id();
        let latches = qos.kept() > 0 && !writer.keeps_samples();
        let of = Some((GraphRole::Publisher, topic.to_owned()));
        let parts = Arc::new(PublisherParts {
            writer,
            peers: Arc::clone(&peers),
            local,
            latch: latches.then(|| Mutex::new(Latch::new(qos))),
            shutdown: self.shutdown.clone(),
            _graph: (self.graph).join(node, EndpointKind::Writer, id, of),
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
        let activity = self.activity.clone();
        peers.on_joined(Box::new(move || activity.note()));
        self.endpoints.register(id, &peers);
        self.endpoints.watch_type(&peers, ros_type);
        Ok(parts)
    }
}
