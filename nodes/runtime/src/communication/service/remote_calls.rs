//! Remote calls of one client, and the correlation of replies with requests.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use smol::Timer;
use smol::channel::{Sender, bounded};

use super::wire::{Header, read_answer, write_request};
use crate::sync::lock;
use crate::transport::outbox::Outbox;
use crate::transport::peers::Peers;
use crate::transport::port::{EndpointId, Origin, SampleReader, ServiceForm};

/// Period of checks whether a server has discovered its client.
const LOOK: Duration = Duration::from_millis(1);

/// Longest wait of a first request for its server to discover the client: the heartbeat period of Fast DDS, after
/// which it repairs discovery.
const MATCH_TIMEOUT: Duration = Duration::from_secs(3);

/// Calls without reply so far.
#[derive(Default)]
pub(crate) struct PendingCalls(Mutex<BTreeMap<Header, Sender<Vec<u8>>>>);

impl PendingCalls {
    /// Passes a reply to its call; replies to other clients are ignored.
    fn hear(&self, bytes: &[u8], origin: &Origin) {
        let Some((request, answer)) = read_answer(bytes, origin) else {
            return;
        };
        if let Some(sender) = lock(&self.0).remove(&request) {
            let _ = sender.try_send(answer);
        }
    }

    /// Receives replies until the task is dropped.
    pub(crate) async fn listen(self: Arc<Self>, answers: Arc<dyn SampleReader>) {
        loop {
            // A rejected sample is not a reply; its call ends by timeout.
            if let Ok(origin) = answers.next().await {
                self.hear(&answers.bytes(), &origin);
            }
            smol::future::yield_now().await;
        }
    }
}

/// Remote calls of one client.
pub(crate) struct RemoteCalls {
    pub form: ServiceForm,
    pub requests: Arc<Outbox>,
    /// Peers of the request writer.
    pub servers: Arc<Peers>,
    /// Peers of the reply reader.
    pub answerers: Arc<Peers>,
    pub answers: Arc<dyn SampleReader>,
    /// Reply writer that was last waited for.
    pub last_matched: Mutex<Option<EndpointId>>,
    pub waiting: Arc<PendingCalls>,
    pub next: AtomicI64,
}

impl RemoteCalls {
    /// Sends a request once a server is discovered, and waits for the reply.
    pub(crate) async fn call(&self, request: &[u8]) -> Result<Vec<u8>, String> {
        let server = self.servers.known(|_| true).await;
        if self.form == ServiceForm::Topics {
            let answerer = self
                .answerers
                .known(|peer| peer.same_participant(&server))
                .await;
            self.until_known_to(&answerer).await;
        }
        let number = self.next.fetch_add(1, Relaxed);
        let asked = write_request(self.form, request, &self.requests.id(), &server, number);
        let asked = asked.ok_or("the request is not little-endian CDR")?;
        let (sender, answer) = bounded(1);
        lock(&self.waiting.0).insert(asked.identity, sender);
        let _forgotten = Forget(&self.waiting, asked.identity);
        self.requests
            .send_body(asked.body, asked.related)
            .map_err(|error| error.to_string())?;
        let answer = answer.recv().await;
        answer.map_err(|_| "the client has ended".to_owned())
    }

    /// Waits until the reply writer has matched our reader: the server may miss a discovery datagram, and a
    /// reply without a matched reader is lost.
    async fn until_known_to(&self, answerer: &EndpointId) {
        if *lock(&self.last_matched) == Some(*answerer) {
            return;
        }
        let begin = Instant::now();
        while !self.answers.is_known_to(answerer) && begin.elapsed() < MATCH_TIMEOUT {
            Timer::after(LOOK).await;
        }
        *lock(&self.last_matched) = Some(*answerer);
    }
}

/// Removes a finished or abandoned call when dropped.
struct Forget<'a>(&'a PendingCalls, Header);

impl Drop for Forget<'_> {
    fn drop(&mut self) {
        lock(&self.0.0).remove(&self.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::port::{EndpointId, SampleId};

    #[test]
    fn answers_go_to_who_asked() {
        let waiting = PendingCalls::default();
        let (sender, answer) = bounded(1);
        lock(&waiting.0).insert([7; 16], sender);
        let sample = SampleId {
            writer: EndpointId([1; 16]),
            number: 1,
        };
        let origin = Origin {
            sample,
            related: None,
        };
        for other in [&[0, 1, 0, 0][..], &[0, 1, 0, 0, 7], &[8; 40]] {
            waiting.hear(other, &origin);
        }
        waiting.hear(&[&[0, 1, 0, 0][..], &[6; 16], b"no"].concat(), &origin);
        assert!(answer.is_empty());
        waiting.hear(&[&[0, 1, 0, 0][..], &[7; 16], b"yes"].concat(), &origin);
        let heard = answer.try_recv().unwrap();
        assert_eq!(heard, [&[0, 1, 0, 0][..], b"yes"].concat());
        assert!(lock(&waiting.0).is_empty());
    }
}
