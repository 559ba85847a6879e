//! Calls of one client over the network, and the correlation of replies with requests.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use smol::Timer;
use smol::channel::{Sender, bounded};

use super::wire::{Header, read_answer, write_request};
use crate::outbox::Outbox;
use crate::peers::Peers;
use crate::port::{EndpointId, Origin, SampleReader, ServiceForm};
use crate::sync::lock;

/// Between two looks whether a server knows its client.
const LOOK: Duration = Duration::from_millis(1);

/// Longest time that a first request waits for its server to know the client: the period of Fast DDS's heartbeats, by which
/// it repairs discovery.
const ACQUAINTANCE: Duration = Duration::from_secs(3);

/// Calls that wait for answers.
#[derive(Default)]
pub(crate) struct Waiting(Mutex<BTreeMap<Header, Sender<Vec<u8>>>>);

impl Waiting {
    /// Hands an answer to who asked; those of other clients are passed over.
    fn hear(&self, bytes: &[u8], origin: &Origin) {
        let Some((request, answer)) = read_answer(bytes, origin) else {
            return;
        };
        if let Some(sender) = lock(&self.0).remove(&request) {
            let _ = sender.try_send(answer);
        }
    }

    /// Hears answers until the task is dropped.
    pub(crate) async fn listen(self: Arc<Self>, answers: Arc<dyn SampleReader>) {
        loop {
            // What cannot be had is no answer; its call ends by time.
            if let Ok(origin) = answers.next().await {
                self.hear(&answers.bytes(), &origin);
            }
            smol::future::yield_now().await;
        }
    }
}

/// Asks over the network.
pub(crate) struct Asking {
    pub form: ServiceForm,
    pub requests: Arc<Outbox>,
    /// The other ends of the requests.
    pub servers: Arc<Peers>,
    /// The other ends of the answers.
    pub answerers: Arc<Peers>,
    pub answers: Arc<dyn SampleReader>,
    /// The one that was waited for last.
    pub acquainted: Mutex<Option<EndpointId>>,
    pub waiting: Arc<Waiting>,
    pub next: AtomicI64,
}

impl Asking {
    /// Asks once a server is known, and waits for the answer.
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
        let asked = asked.ok_or("the request is no CDR of this order")?;
        let (sender, answer) = bounded(1);
        lock(&self.waiting.0).insert(asked.identity, sender);
        let _forgotten = Forget(&self.waiting, asked.identity);
        self.requests
            .send_body(asked.body, asked.related)
            .map_err(|error| error.to_string())?;
        let answer = answer.recv().await;
        answer.map_err(|_| "the client has ended".to_owned())
    }

    /// Waits until the writer of the answers has matched our reader: a datagram of discovery may be lost on its way there,
    /// and an answer to nobody is lost for good.
    async fn until_known_to(&self, answerer: &EndpointId) {
        if *lock(&self.acquainted) == Some(*answerer) {
            return;
        }
        let begin = Instant::now();
        while !self.answers.is_known_to(answerer) && begin.elapsed() < ACQUAINTANCE {
            Timer::after(LOOK).await;
        }
        *lock(&self.acquainted) = Some(*answerer);
    }
}

/// Forgets a call that is over, or that nobody waits for any more.
struct Forget<'a>(&'a Waiting, Header);

impl Drop for Forget<'_> {
    fn drop(&mut self) {
        lock(&self.0.0).remove(&self.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{EndpointId, SampleId};

    #[test]
    fn answers_go_to_who_asked() {
        let waiting = Waiting::default();
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
