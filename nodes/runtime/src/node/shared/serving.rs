//! Servers of the process.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

use lattice_msgs::{RosMessage, RosService, know_service};
use smol::channel::bounded;

use super::{Shared, closed};
use crate::communication::service::{Reply, Server, Serving, Unanswered};
use crate::error::RuntimeError;
use crate::graph::local_graph::NodeId;
use crate::logging::Throttle;
use crate::sync::lock;
use crate::transport::outbox::WhenFull;
use crate::transport::peers::Peers;
use crate::transport::port::{EndpointKind, PortService, ServerEnds, ServiceQos};
use crate::transport::qos::Qos;
use crate::transport::remote::GraphRole;

/// QoS of servers: requests are short.
const QOS: ServiceQos = ServiceQos {
    reader: Qos::REQUESTS,
    writer: Qos::SERVICES,
    max_bytes: 1 << 20,
};

/// Period of warnings about undecodable requests.
const WARNING_PERIOD: Duration = Duration::from_secs(5);

impl Shared {
    /// Serves `S` under a full name, with up to `max_pending` requests in progress.
    pub(crate) fn serve<S: RosService + 'static>(
        &self,
        node: NodeId,
        name: &str,
        max_pending: usize,
        mut handler: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        let clients = Arc::new(Peers::new(name, "client", log::Level::Debug));
        let readers = Arc::new(Peers::new(name, "reply reader", log::Level::Debug));
        know_service::<S>();
        let service = PortService {
            node: &self.graph.node(node),
            name,
            ros_type: S::TYPE,
            request: S::Request::TYPE,
            response: S::Response::TYPE,
        };
        let ServerEnds {
            form,
            requests,
            replies,
        } = self.transport(name, |transport| transport.server(service, &QOS))?;
        let replies = self.outbox_of(name, replies, WhenFull::Drop)?;
        let (reader, writer) = (EndpointKind::Reader, EndpointKind::Writer);
        let of = Some((GraphRole::Server, name.to_owned()));
        let graph = [
            (self.graph).join(node, reader, requests.id(), of),
            (self.graph).join(node, writer, replies.id(), None),
        ];
        self.endpoints.register(requests.id(), &clients);
        self.endpoints.register(replies.id(), &readers);
        let (end, ending) = bounded(1);
        self.answers.add(end, &replies);
        let unanswered = Arc::new(Unanswered {
            name: name.to_owned(),
            lost: AtomicU64::new(0),
            failed: AtomicU64::new(0),
        });
        if let Some(open) = lock(&self.open).as_mut() {
            let of_live = |of: &Weak<Unanswered>| of.strong_count() > 0;
            open.unanswered.retain(of_live);
            open.unanswered.push(Arc::downgrade(&unanswered));
        }
        let serving = Serving {
            form,
            unanswered,
            requests,
            local: self.services.add(name, S::TYPE),
            replies,
            readers,
            absent: Mutex::default(),
            ending,
            max_pending: max_pending.max(1),
            warning: Throttle::new(WARNING_PERIOD),
        };
        let activity = self.activity.clone();
        let handler = move |request, reply| {
            handler(request, reply);
            activity.note();
        };
        let task = self
            .io
            .spawn(serving.run::<S>(handler))
            .ok_or_else(|| closed(name))?;
        Ok(Server {
            name: name.to_owned(),
            _clients: clients,
            _task: task,
            _graph: graph,
        })
    }
}
