//! The Zenoh session of the process and its endpoints.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread;

use futures::StreamExt;
use futures::stream::BoxStream;
use lattice_msgs::{dds_type_name, hash_of};
use smol::channel::{Receiver, unbounded};
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::SampleKind;

use super::config::{self, CHECK_PERIOD, RouterCheck};
use super::error_text::words;
use super::graph::{Graph, Place};
use super::keys::{Channel, Kind, Session, gid};
use super::publisher::ZenohPublisher;
use super::service;
use super::subscriber::InboxReader;
use crate::config::env::Network;
use crate::config::security::Enclave;
use crate::error::RuntimeError;
use crate::sync::lock;
use crate::transport::port::{
    ClientEnds, EndpointId, PortEvent, PortNode, PortService, PortTopic, SampleReader,
    SampleWriter, ServerEnds, ServiceQos, Transport,
};
use crate::transport::qos::Qos;
use crate::transport::remote::is_type_hash;

/// The Zenoh session of a process.
pub(crate) struct Zenoh {
    // Field order is drop order: tokens are undeclared while the session is open.
    nodes: Mutex<Vec<LivelinessToken>>,
    _tokens: Subscriber<()>,
    graph: Arc<Graph>,
    names: Session,
    next_endpoint: AtomicU64,
    events: Receiver<PortEvent>,
    session: zenoh::Session,
}

/// Endpoint to be created.
struct Prepared {
    id: EndpointId,
    token: String,
    kind: Kind,
    channel: Channel,
}

impl Zenoh {
    /// Opens the session for the network settings, and waits for a router as configured.
    pub(crate) fn open(network: &Network, enclave: &Enclave) -> Result<Self, RuntimeError> {
        let failed = |reason: String| RuntimeError::Session { reason };
        if enclave.secrets.is_some() {
            return Err(failed(
                "ROS_SECURITY_ENABLE is true, which secures DDS only; unset it, and configure TLS between the Zenoh \
                 routers of the machines"
                    .to_owned(),
            ));
        }
        for warning in config::warnings(network) {
            log::warn!("{warning}");
        }
        let (config, check) = config::config(network).map_err(failed)?;
        let session = zenoh::open(config).wait();
        let session = session.map_err(|error| failed(words(error)))?;
        wait_for_router(&session, check);
        Self::on(session, network.domain_id, &enclave.name).map_err(|error| failed(words(error)))
    }

    fn on(session: zenoh::Session, domain: u16, enclave: &str) -> zenoh::Result<Self> {
        let names = Session {
            domain,
            zid: session.zid().to_string(),
            enclave: enclave.to_owned(),
        };
        let (sender, events) = unbounded();
        let graph = Graph::new(&names.zid, sender);
        let heard = Arc::clone(&graph);
        let tokens = session
            .liveliness()
            .declare_subscriber(names.all_tokens())
            .history(true)
            .callback(move |sample| match sample.kind() {
                SampleKind::Put => heard.declared(sample.key_expr()),
                SampleKind::Delete => heard.undeclared(sample.key_expr()),
            })
            .wait()?;
        Ok(Self {
            nodes: Mutex::default(),
            _tokens: tokens,
            graph,
            names,
            next_endpoint: AtomicU64::new(0),
            events,
            session,
        })
    }

    fn prepare(&self, node: &PortNode, kind: Kind, channel: Channel, qos: &Qos) -> Prepared {
        let number = self.next_endpoint.fetch_add(1, Relaxed);
        let names = &self.names;
        let token = names.endpoint_token(node, number, kind, &channel, qos);
        Prepared {
            id: gid(&token),
            token,
            kind,
            channel,
        }
    }

    /// Announces an endpoint that is ready.
    fn announce(&self, of: &Prepared) -> zenoh::Result<(LivelinessToken, Place)> {
        let token = self.session.liveliness().declare_token(&of.token).wait()?;
        Ok((token, self.graph.add(of.id, of.kind, &of.channel)))
    }

    fn key(&self, of: &Prepared) -> (EndpointId, String) {
        (of.id, of.channel.key(self.names.domain))
    }
}

/// Waits for a router, as rmw_zenoh does.
fn wait_for_router(session: &zenoh::Session, check: RouterCheck) {
    let attempts = match check {
        RouterCheck::Skipped => return,
        RouterCheck::Attempts(attempts) => attempts,
        RouterCheck::Endless => u64::MAX,
    };
    for attempt in 1..=attempts {
        if session.info().routers_zid().wait().next().is_some() {
            return;
        }
        if attempt == attempts {
            log::warn!(
                "no Zenoh router found ({attempts} checks, ZENOH_ROUTER_CHECK_ATTEMPTS). Nodes of \
                 other processes are not found before one runs: `ros2 run rmw_zenoh_cpp rmw_zenohd` or `zenohd`; \
                 or set ZENOH_CONFIG_OVERRIDE='scouting/multicast/enabled=true' for all nodes"
            );
            return;
        }
        if attempt == 1 {
            log::warn!(
                "waiting for a Zenoh router: run `ros2 run rmw_zenoh_cpp rmw_zenohd` or `zenohd`"
            );
        }
        thread::sleep(CHECK_PERIOD);
    }
}

/// Topic and type of an endpoint.
fn channel(name: &str, ros_type: &str, hash: Option<&str>) -> Result<Channel, RuntimeError> {
    let hash = hash.filter(|text| is_type_hash(text));
    let dds_type = dds_type_name(ros_type).ok_or_else(|| RuntimeError::TypeName {
        topic: name.to_owned(),
        type_name: ros_type.to_owned(),
    })?;
    Ok(Channel {
        name: name.to_owned(),
        dds_type,
        hash: hash.or_else(|| hash_of(ros_type)).map(str::to_owned),
    })
}

/// Channel of an endpoint whose key requires the type hash.
fn hashed(
    name: &str,
    ros_type: &str,
    hash: Option<&str>,
    endpoint: &'static str,
) -> Result<Channel, RuntimeError> {
    let channel = channel(name, ros_type, hash)?;
    match &channel.hash {
        Some(_) => Ok(channel),
        None => Err(failed(
            name,
            endpoint,
            format!("the type hash of {ros_type}, required for its Zenoh key, is unknown"),
        )),
    }
}

fn failed(name: &str, endpoint: &'static str, reason: impl ToString) -> RuntimeError {
    RuntimeError::Endpoint {
        topic: name.to_owned(),
        endpoint,
        reason: words(reason),
    }
}

impl Transport for Zenoh {
    fn id(&self) -> EndpointId {
        gid(&self.names.zid)
    }

    fn add_node(&self, node: &PortNode) -> Result<(), RuntimeError> {
        let token = self.names.node_token(node);
        let token = self.session.liveliness().declare_token(token).wait();
        let token = token.map_err(|error| RuntimeError::Session {
            reason: format!("node {}: {}", node.name, words(error)),
        })?;
        lock(&self.nodes).push(token);
        Ok(())
    }

    /// Creates a writer. Zenoh waits for reliable subscribers whether or not the writer keeps its samples.
    fn writer(
        &self,
        of: PortTopic<'_>,
        qos: &Qos,
        _keeps: bool,
    ) -> Result<Arc<dyn SampleWriter>, RuntimeError> {
        const WHAT: &str = "publisher";
        let channel = hashed(of.name, of.ros_type, of.type_hash, WHAT)?;
        let made = self.prepare(of.node, Kind::Publisher, channel, qos);
        let announce = || self.announce(&made);
        let writer = ZenohPublisher::new(&self.session, self.key(&made), qos, announce);
        let writer = writer.map_err(|error| failed(of.name, WHAT, error))?;
        Ok(Arc::new(writer))
    }

    fn reader(
        &self,
        of: PortTopic<'_>,
        qos: &Qos,
        max_bytes: usize,
    ) -> Result<Box<dyn SampleReader>, RuntimeError> {
        let channel = channel(of.name, of.ros_type, of.type_hash)?;
        let made = self.prepare(of.node, Kind::Subscription, channel, qos);
        let (session, key, announce) = (&self.session, self.key(&made), || self.announce(&made));
        let reader = InboxReader::subscribe(session, key, qos, max_bytes, &self.graph, announce);
        let reader = reader.map_err(|error| failed(of.name, "subscription", error))?;
        Ok(Box::new(reader))
    }

    fn server(&self, of: PortService<'_>, qos: &ServiceQos) -> Result<ServerEnds, RuntimeError> {
        const WHAT: &str = "service";
        let channel = hashed(of.name, of.ros_type, None, WHAT)?;
        let made = self.prepare(of.node, Kind::Server, channel, &Qos::SERVICES);
        let announce = || self.announce(&made);
        let ends = service::serve(&self.session, self.key(&made), qos, announce);
        ends.map_err(|error| failed(of.name, WHAT, error))
    }

    fn client(&self, of: PortService<'_>, qos: &ServiceQos) -> Result<ClientEnds, RuntimeError> {
        const WHAT: &str = "client";
        let channel = hashed(of.name, of.ros_type, None, WHAT)?;
        let made = self.prepare(of.node, Kind::Client, channel, &Qos::SERVICES);
        let announce = || self.announce(&made);
        let ends = service::call(&self.session, self.key(&made), qos, announce);
        ends.map_err(|error| failed(of.name, WHAT, error))
    }

    fn events(&self) -> BoxStream<'static, PortEvent> {
        self.events.clone().boxed()
    }
}

impl Drop for Zenoh {
    fn drop(&mut self) {
        lock(&self.nodes).clear();
        if let Err(error) = self.session.close().wait() {
            log::debug!("the Zenoh session does not close: {error}");
        }
    }
}
