//! Service clients, for servers in this process or another.

use std::sync::atomic::AtomicI64;
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

use lattice_msgs::{RosMessage, RosService, know_service};
use smol::channel::bounded;
use smol::future::or;
use smol::{Task, Timer};
use thiserror::Error;

use super::{Shared, closed};
use crate::communication::service::{LocalCall, PendingCalls, RemoteCalls};
use crate::error::RuntimeError;
use crate::graph::local_graph::{NodeEndpoint, NodeId};
use crate::sync::lock;
use crate::transport::outbox::WhenFull;
use crate::transport::peers::Peers;
use crate::transport::port::{ClientEnds, EndpointKind, PortService, SampleReader, ServiceQos};
use crate::transport::qos::Qos;

/// QoS of clients: replies are longer than requests.
const QOS: ServiceQos = ServiceQos {
    reader: Qos::SERVICES,
    writer: Qos::SERVICES,
    max_bytes: 4 << 20,
};

/// Reason for a call without reply.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CallError {
    /// No server was discovered within the timeout.
    #[error("no server of {name} is discovered: start its node, or see `lattice doctor`")]
    NoServer {
        /// Full name of the service.
        name: String,
    },
    /// The server did not reply in time.
    #[error("{name} did not reply within {patience_s} s; call again when its node has less work")]
    Late {
        /// Full name of the service.
        name: String,
        /// Timeout, s.
        patience_s: f64,
    },
    /// The call was rejected, or not sent.
    #[error("{name}: {reason}")]
    Failed {
        /// Full name of the service.
        name: String,
        /// Reason as text.
        reason: String,
    },
}

/// A service client. Clones share the client.
#[derive(Clone)]
pub struct Client(Arc<Inner>);

struct Inner {
    shared: Weak<Shared>,
    node: NodeId,
    name: String,
    service: &'static str,
    request: &'static str,
    response: &'static str,
    remote: Mutex<Option<Arc<Remote>>>,
}

/// Endpoints of a client.
struct Remote {
    remote_calls: RemoteCalls,
    _task: Task<()>,
    _graph: [NodeEndpoint; 2],
}

impl Client {
    /// Full name of the service.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Calls with little-endian CDR, encapsulation header first, and returns the reply as CDR. Dropping the future
    /// cancels the call.
    pub fn call(
        &self,
        request: Vec<u8>,
        patience: Duration,
    ) -> impl Future<Output = Result<Vec<u8>, CallError>> + Send + 'static {
        let client = Arc::clone(&self.0);
        async move {
            let late = async {
                Timer::after(patience).await;
                Err(client.late(patience))
            };
            or(client.call(request), late).await
        }
    }

    /// Calls as [`Client::call`], and blocks until the reply. Not from a handler, callback or timer.
    pub fn call_blocking(
        &self,
        request: Vec<u8>,
        patience: Duration,
    ) -> Result<Vec<u8>, CallError> {
        smol::block_on(self.call(request, patience))
    }
}

impl Inner {
    async fn call(&self, request: Vec<u8>) -> Result<Vec<u8>, CallError> {
        let answer = match self.local() {
            Some(server) => {
                let (answered, answer) = bounded(1);
                match server.try_send(LocalCall { request, answered }) {
                    Ok(()) => answer
                        .recv()
                        .await
                        .unwrap_or(Err("the server has ended".into())),
                    Err(_) => Err("the server is busy; retry".to_owned()),
                }
            }
            None => match self.remote() {
                Ok(remote) => remote.remote_calls.call(&request).await,
                Err(error) => Err(error.to_string()),
            },
        };
        answer.map_err(|reason| CallError::Failed {
            name: self.name.clone(),
            reason,
        })
    }

    /// Server in this process. It needs no DDS endpoints.
    fn local(&self) -> Option<smol::channel::Sender<LocalCall>> {
        let shared = self.shared.upgrade()?;
        let server = shared.services.find(&self.name, self.service)?;
        *lock(&self.remote) = None;
        Some(server)
    }

    fn remote(&self) -> Result<Arc<Remote>, RuntimeError> {
        let mut remote = lock(&self.remote);
        if let Some(remote) = &*remote {
            return Ok(Arc::clone(remote));
        }
        let shared = self.shared.upgrade().ok_or_else(|| closed(&self.name))?;
        let made = Arc::new(shared.remote(self)?);
        *remote = Some(Arc::clone(&made));
        Ok(made)
    }

    fn late(&self, patience: Duration) -> CallError {
        let name = self.name.clone();
        let remote = lock(&self.remote);
        match &*remote {
            Some(remote) if remote.remote_calls.servers.remote() == 0 => {
                CallError::NoServer { name }
            }
            _ => CallError::Late {
                name,
                patience_s: patience.as_secs_f64(),
            },
        }
    }
}

impl Shared {
    /// Creates a client of `S` under a full name.
    pub(crate) fn client<S: RosService>(self: &Arc<Self>, node: NodeId, name: String) -> Client {
        know_service::<S>();
        Client(Arc::new(Inner {
            shared: Arc::downgrade(self),
            node,
            name,
            service: S::TYPE,
            request: S::Request::TYPE,
            response: S::Response::TYPE,
            remote: Mutex::default(),
        }))
    }

    fn remote(&self, client: &Inner) -> Result<Remote, RuntimeError> {
        let name = &client.name;
        let service = PortService {
            node: &self.graph.node(client.node),
            name,
            ros_type: client.service,
            request: client.request,
            response: client.response,
        };
        let ClientEnds {
            form,
            requests,
            answers,
        } = self.transport(name, |transport| transport.client(service, &QOS))?;
        let requests = self.outbox_of(name, requests, WhenFull::Drop)?;
        let answers: Arc<dyn SampleReader> = Arc::from(answers);
        let (reader, writer) = (EndpointKind::Reader, EndpointKind::Writer);
        let graph = [
            (self.graph).join(client.node, reader, answers.id(), None),
            (self.graph).join(client.node, writer, requests.id(), None),
        ];
        let [servers, answerers] = ["server", "answer writer"]
            .map(|kind| Arc::new(Peers::new(name, kind, log::Level::Debug)));
        self.endpoints.register(requests.id(), &servers);
        self.endpoints.register(answers.id(), &answerers);
        let waiting = Arc::new(PendingCalls::default());
        let listen = Arc::clone(&waiting).listen(Arc::clone(&answers));
        let task = self.io.spawn(listen).ok_or_else(|| closed(name))?;
        let next = AtomicI64::new(1);
        Ok(Remote {
            remote_calls: RemoteCalls {
                form,
                requests,
                servers,
                answerers,
                answers,
                last_matched: Mutex::default(),
                waiting,
                next,
            },
            _task: task,
            _graph: graph,
        })
    }
}
