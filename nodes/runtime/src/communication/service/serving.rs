//! Server task: takes requests, and sends each reply once the client's reader is matched.

use std::collections::BTreeSet;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures::StreamExt;
use futures::stream::FuturesUnordered;
use lattice_msgs::{RosMessage, RosService, cdr};
use smol::Timer;
use smol::channel::{Receiver, Sender};
use smol::future::{self, or};

use super::local::LocalCall;
use super::wire::{ReplyTo, read_request, write_reply};
use super::{Reply, Unanswered};
use crate::logging::Throttle;
use crate::sync::lock;
use crate::transport::outbox::Outbox;
use crate::transport::peers::Peers;
use crate::transport::port::{EndpointId, Origin, SampleReader, ServiceForm};
use crate::transport::qos::Qos;

/// Longest wait for the reply reader of a client: a reply sent before its match would be lost. Fast DDS
/// repairs a lost announcement after 3 s.
const WAIT_FOR_CLIENT: Duration = Duration::from_secs(5);

/// Limit of stored clients whose reply reader never matched.
const MAX_ABSENT: usize = 4096;

/// A running server.
pub(crate) struct Serving {
    pub form: ServiceForm,
    pub unanswered: Arc<Unanswered>,
    pub requests: Box<dyn SampleReader>,
    /// Requests of this process.
    pub local: Receiver<LocalCall>,
    pub replies: Arc<Outbox>,
    /// Peers of the reply writer.
    pub readers: Arc<Peers>,
    /// Clients whose reply reader did not match in time. Their further requests do not wait, nor delay
    /// others.
    pub absent: Mutex<BTreeSet<EndpointId>>,
    pub ending: Receiver<Sender<()>>,
    /// Limit of requests in progress.
    pub max_pending: usize,
    pub warning: Throttle,
}

/// A request in progress.
struct PendingRequest<R> {
    answered: Receiver<R>,
    client: Requester,
}

/// Sender of a request.
enum Requester {
    Remote { reply_to: ReplyTo, id: EndpointId },
    Local(Sender<Result<Vec<u8>, String>>),
}

/// Next event of a server.
enum ServerEvent {
    Take(Result<Origin, String>),
    TakeLocal(LocalCall),
    Answered(Result<(), String>),
    End(Sender<()>),
}

impl Serving {
    /// Serves until the task is dropped, or until shutdown with all requests replied to.
    pub(crate) async fn run<S: RosService>(
        self,
        mut handler: impl FnMut(S::Request, Reply<S::Response>),
    ) {
        let mut pending = FuturesUnordered::new();
        let mut ended = None;
        while ended.is_none() || !pending.is_empty() {
            let takes = ended.is_none() && pending.len() < self.max_pending;
            let take = async {
                match takes {
                    true => {
                        let remote = async { ServerEvent::Take(self.requests.next().await) };
                        or(self.next_local(), remote).await
                    }
                    false => future::pending().await,
                }
            };
            let answered = async {
                match pending.next().await {
                    Some(result) => ServerEvent::Answered(result),
                    None => future::pending().await,
                }
            };
            let end = async {
                match self.ending.recv().await {
                    Ok(done) => ServerEvent::End(done),
                    Err(_) => future::pending().await,
                }
            };
            let outcome = match or(end, or(answered, take)).await {
                ServerEvent::Take(sample) => {
                    self.count_lost();
                    self.ask::<S>(sample, &mut handler)
                        .map(|asked| pending.push(self.answer(asked)))
                }
                ServerEvent::TakeLocal(call) => {
                    pending.extend(
                        ask_locally::<S>(call, &mut handler).map(|asked| self.answer(asked)),
                    );
                    Ok(())
                }
                ServerEvent::Answered(result) => result,
                ServerEvent::End(done) => {
                    ended = Some(done);
                    Ok(())
                }
            };
            if let Err(why) = outcome {
                self.unanswered.failed.fetch_add(1, Relaxed);
                self.warn(&format!("request not answered: {why}"));
            }
            future::yield_now().await;
        }
    }

    async fn next_local(&self) -> ServerEvent {
        match self.local.recv().await {
            Ok(call) => ServerEvent::TakeLocal(call),
            // Another server has taken the name.
            Err(_) => future::pending().await,
        }
    }

    /// Counts requests lost since the last one.
    fn count_lost(&self) {
        let lost = self.requests.losses().overrun.swap(0, Relaxed);
        if lost > 0 {
            self.unanswered.lost.fetch_add(lost, Relaxed);
            self.warn(&format!(
                "{lost} requests lost: more than {} were queued; retry",
                Qos::REQUESTS.depth
            ));
        }
    }

    fn warn(&self, problem: &str) {
        if self.warning.check().is_some() {
            log::warn!("{}: {problem}", self.unanswered.name);
        }
    }

    fn ask<S: RosService>(
        &self,
        sample: Result<Origin, String>,
        handler: &mut impl FnMut(S::Request, Reply<S::Response>),
    ) -> Result<PendingRequest<S::Response>, String> {
        let origin = sample?;
        let (request, reply_to) =
            read_request::<S::Request>(self.form, &self.requests.bytes(), &origin)
                .map_err(|e| e.to_string())?;
        let (reply, answered) = Reply::channel();
        handler(request, reply);
        let id = origin.sample.writer;
        let client = Requester::Remote { reply_to, id };
        Ok(PendingRequest { answered, client })
    }

    async fn answer<R: RosMessage>(&self, asked: PendingRequest<R>) -> Result<(), String> {
        let answer = asked.answered.recv().await;
        let reply = answer.map_err(|_| "no reply was sent".to_owned());
        let (reply_to, id) = match asked.client {
            Requester::Remote { reply_to, id } => (reply_to, id),
            Requester::Local(to) => {
                let written = |reply| cdr::to_vec(&reply).map_err(|e| e.to_string());
                // The caller may have stopped waiting.
                let _ = to.try_send(reply.and_then(written));
                return Ok(());
            }
        };
        let (body, related) = write_reply(&reply?, &reply_to).map_err(|e| e.to_string())?;
        if self.form == ServiceForm::Topics {
            self.wait_for_reader(&id).await;
        }
        self.replies
            .send_body(body, related)
            .map_err(|e| e.to_string())
    }

    async fn wait_for_reader(&self, client: &EndpointId) {
        let patience = match lock(&self.absent).contains(client) {
            true => Duration::ZERO,
            false => WAIT_FOR_CLIENT,
        };
        let known = async {
            self.readers
                .known(|reader| reader.same_participant(client))
                .await;
            true
        };
        let timeout = async {
            Timer::after(patience).await;
            false
        };
        let is_known = or(known, timeout).await;
        let mut absent = lock(&self.absent);
        if is_known {
            absent.remove(client);
        } else if absent.len() < MAX_ABSENT {
            absent.insert(*client);
        }
    }
}

/// Passes a local call to the handler; a malformed request is rejected at once.
fn ask_locally<S: RosService>(
    call: LocalCall,
    handler: &mut impl FnMut(S::Request, Reply<S::Response>),
) -> Option<PendingRequest<S::Response>> {
    let client = Requester::Local(call.answered.clone());
    match cdr::from_slice(&call.request) {
        Ok(request) => {
            let (reply, answered) = Reply::channel();
            handler(request, reply);
            Some(PendingRequest { answered, client })
        }
        Err(error) => {
            let _ = call.answered.try_send(Err(error.to_string()));
            None
        }
    }
}
