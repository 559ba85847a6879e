//! Servers of services, for clients of either rmw.

use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::stream::FuturesUnordered;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_msgs::{RosMessage, RosService};
use rustdds::GUID;
use smol::channel::{Receiver, Sender, bounded};
use smol::future::{self, or};
use smol::{Task, Timer};

use super::core::Core;
use super::dds::reader::{DdsReader, SampleOrigin};
use super::dds::writer::{DdsWriter, WhenFull};
use super::error::RuntimeError;
use super::graph::{EndpointKind, Membership, NodeId};
use super::logging::Throttle;
use super::names;
use super::node::Node;
use super::peers::Peers;
use super::qos::Qos;
use super::reader_port::wait_for;
use super::service_wire::{ReplyTo, read_request, write_reply};
use super::sync::lock;

/// Requests are short.
const MAX_REQUEST_BYTES: usize = 4 << 20;

/// A client may ask before its reply reader is known here; a reply sent then would be lost.
const WAIT_FOR_CLIENT: Duration = Duration::from_secs(1);

/// Between two warnings of unreadable requests.
const WARNING_PERIOD: Duration = Duration::from_secs(5);

/// A server of a service; dropping it ends it.
#[must_use = "dropping a server ends it"]
pub struct Server {
    name: String,
    clients: Arc<Peers>,
    _task: Task<()>,
    _graph: [Membership; 2],
}

impl Server {
    /// Full name of the service.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Clients that could send a request now.
    pub fn client_count(&self) -> usize {
        self.clients.count()
    }
}

/// Answers one request, from any thread. Of clones, the first to send counts.
pub struct Reply<R>(Sender<R>);

impl<R> Clone for Reply<R> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<R> Reply<R> {
    /// Sends the answer. A request whose reply is dropped instead is not answered.
    pub fn send(self, response: R) {
        // The server may have ended.
        let _ = self.0.try_send(response);
    }

    /// A reply that goes to the receiver instead of a client.
    pub fn channel() -> (Self, Receiver<R>) {
        let (sender, receiver) = bounded(1);
        (Self(sender), receiver)
    }
}

impl Node {
    /// Serves `S`; the handler runs on the io thread and must return at once.
    pub fn service<S: RosService + 'static>(
        &self,
        name: &str,
        mut handler: impl FnMut(S::Request) -> S::Response + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        self.service_later::<S>(name, move |request, reply| reply.send(handler(request)))
    }

    /// Serves `S` with answers that may take their time: the handler runs on the io thread and must
    /// return at once, the reply may be sent later. The next request waits until then.
    pub fn service_later<S: RosService + 'static>(
        &self,
        name: &str,
        handler: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        self.service_concurrent::<S>(name, 1, handler)
    }

    /// Serves `S` with answers that may take their time, up to `max_pending` of them at a time; further
    /// requests wait.
    pub fn service_concurrent<S: RosService + 'static>(
        &self,
        name: &str,
        max_pending: usize,
        handler: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        let name = self.resolve_service(name)?;
        self.core()
            .serve::<S>(self.id(), &name, max_pending, handler)
    }

    /// Serves `std_srvs/srv/Trigger`; the handler answers success and what came of it.
    pub fn service_trigger(
        &self,
        name: &str,
        mut handler: impl FnMut() -> (bool, String) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        self.service::<Trigger>(name, move |_: TriggerRequest| {
            let (success, message) = handler();
            TriggerResponse { success, message }
        })
    }
}

impl Core {
    pub(crate) fn serve<S: RosService + 'static>(
        &self,
        node: NodeId,
        name: &str,
        max_pending: usize,
        handler: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        let clients = Arc::new(Peers::of_server(name));
        let topic = names::dds_request(name);
        let requests = self.dds_reader(
            name,
            topic,
            S::Request::TYPE,
            &Qos::SERVICES,
            MAX_REQUEST_BYTES,
        )?;
        let readers = Arc::new(Peers::of_replies(name));
        let topic = names::dds_reply(name);
        let replies = self.dds_writer(
            name,
            topic,
            S::Response::TYPE,
            &Qos::SERVICES,
            WhenFull::Drop,
        )?;
        let graph = [
            self.graph.join(node, EndpointKind::Reader, requests.guid()),
            self.graph.join(node, EndpointKind::Writer, replies.guid()),
        ];
        self.endpoints.register(requests.guid(), &clients);
        self.endpoints.register(replies.guid(), &readers);
        let (end, ending) = bounded(1);
        self.answers.add(end, &replies);
        let serving = Serving {
            name: name.to_owned(),
            requests,
            replies,
            readers,
            ending,
            max_pending: max_pending.max(1),
            warning: Throttle::new(WARNING_PERIOD),
        };
        let task =
            self.io
                .spawn(serving.run::<S>(handler))
                .ok_or_else(|| RuntimeError::Closed {
                    topic: name.to_owned(),
                })?;
        Ok(Server {
            name: name.to_owned(),
            clients,
            _task: task,
            _graph: graph,
        })
    }
}

struct Serving {
    name: String,
    requests: DdsReader,
    replies: Arc<DdsWriter>,
    readers: Arc<Peers>,
    ending: Receiver<Sender<()>>,
    max_pending: usize,
    warning: Throttle,
}

/// A request that waits for its answer.
struct Asked<R> {
    answered: Receiver<R>,
    reply_to: ReplyTo,
    client: GUID,
}

/// Next event of a server.
enum Step {
    Take(Result<SampleOrigin, String>),
    Answered(Result<(), String>),
    End(Sender<()>),
}

/// The servers of a process, for its end.
#[derive(Default)]
pub(crate) struct Answers {
    servers: Mutex<Vec<(Sender<Sender<()>>, Weak<DdsWriter>)>>,
}

impl Answers {
    fn add(&self, end: Sender<Sender<()>>, replies: &Arc<DdsWriter>) {
        let mut servers = lock(&self.servers);
        servers.retain(|(end, _)| !end.is_closed());
        servers.push((end, Arc::downgrade(replies)));
    }

    /// Ends all servers once they have queued their answers to the requests they have taken; an answer
    /// that does not come holds them up until `deadline`. Returns the writers of the answers.
    pub(crate) fn end(&self, deadline: Instant) -> Vec<Arc<DdsWriter>> {
        let servers = std::mem::take(&mut *lock(&self.servers));
        let (done, all_done) = bounded(1);
        let mut writers = Vec::new();
        for (end, replies) in servers {
            // Fails where the server has ended.
            let _ = end.try_send(done.clone());
            writers.extend(replies.upgrade());
        }
        drop(done);
        if !wait_for(
            &all_done,
            deadline.saturating_duration_since(Instant::now()),
        ) {
            log::warn!("not every request was answered");
        }
        writers
    }
}

impl Serving {
    async fn run<S: RosService>(self, mut handler: impl FnMut(S::Request, Reply<S::Response>)) {
        let mut pending = FuturesUnordered::new();
        let mut ended = None;
        while ended.is_none() || !pending.is_empty() {
            let takes = ended.is_none() && pending.len() < self.max_pending;
            let take = async {
                match takes {
                    true => Step::Take(self.requests.next().await),
                    false => future::pending().await,
                }
            };
            let answered = async {
                match pending.next().await {
                    Some(result) => Step::Answered(result),
                    None => future::pending().await,
                }
            };
            let end = async {
                match self.ending.recv().await {
                    Ok(done) => Step::End(done),
                    Err(_) => future::pending().await,
                }
            };
            let outcome = match or(end, or(answered, take)).await {
                Step::Take(sample) => self
                    .ask::<S>(sample, &mut handler)
                    .map(|asked| pending.push(self.answer(asked))),
                Step::Answered(result) => result,
                Step::End(done) => {
                    ended = Some(done);
                    Ok(())
                }
            };
            if let Err(why) = outcome
                && self.warning.check().is_some()
            {
                log::warn!("{}: request not answered: {why}", self.name);
            }
            future::yield_now().await;
        }
    }

    fn ask<S: RosService>(
        &self,
        sample: Result<SampleOrigin, String>,
        handler: &mut impl FnMut(S::Request, Reply<S::Response>),
    ) -> Result<Asked<S::Response>, String> {
        let origin = sample?;
        let (request, reply_to) = read_request::<S::Request>(&self.requests.bytes(), &origin)
            .map_err(|e| e.to_string())?;
        let (reply, answered) = Reply::channel();
        handler(request, reply);
        Ok(Asked {
            answered,
            reply_to,
            client: origin.writer,
        })
    }

    async fn answer<R: RosMessage>(&self, asked: Asked<R>) -> Result<(), String> {
        let answer = asked.answered.recv().await;
        let reply = answer.map_err(|_| "nobody answered it".to_owned())?;
        let (body, related) = write_reply(&reply, &asked.reply_to).map_err(|e| e.to_string())?;
        self.wait_for_reader(&asked.client).await;
        self.replies
            .send_body(body, related)
            .map_err(|e| e.to_string())
    }

    async fn wait_for_reader(&self, client: &GUID) {
        let known = self.readers.known(|reader| reader.prefix == client.prefix);
        let timeout = async {
            Timer::after(WAIT_FOR_CLIENT).await;
        };
        or(known, timeout).await;
    }
}
