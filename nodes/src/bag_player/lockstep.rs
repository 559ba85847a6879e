//! Lockstep: each message of a topic waits for the reply to the one before it on another topic.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::{Node, RemotePublisher, Subscription, SubscriptionExecutor};

use super::commands::SLICE;
use crate::start::NodeError;

/// Queue depth of reply subscriptions.
const DEPTH: usize = 100;
/// Length of the CDR encapsulation header.
const ENCAPSULATION_BYTES: usize = 4;

/// Topics in lockstep, by their index in the player.
#[derive(Default)]
pub(super) struct Lockstep(BTreeMap<usize, Pair>);

/// A played topic and its reply topic.
struct Pair {
    answers: String,
    awaited: Arc<Awaited>,
    /// True after a timeout, until the next reply.
    given_up: bool,
    _subscription: Subscription,
}

/// Stamp of the message without reply so far.
#[derive(Default)]
struct Awaited {
    stamp: Mutex<Option<[u8; 8]>>,
    answered: Condvar,
}

impl Awaited {
    fn lock(&self) -> MutexGuard<'_, Option<[u8; 8]>> {
        self.stamp.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records a reply.
    fn answer(&self, cdr: &[u8]) {
        let mut stamp = self.lock();
        if stamp.is_some() && *stamp == stamp_of(cdr) {
            *stamp = None;
            self.answered.notify_all();
        }
    }

    /// Waits until no reply is pending; false after a timeout, or once `go_on` returns false.
    fn wait(&self, patience: Duration, go_on: &mut dyn FnMut() -> bool) -> bool {
        let deadline = Instant::now() + patience;
        loop {
            let stamp = self.lock();
            let left = deadline.saturating_duration_since(Instant::now());
            if stamp.is_none() {
                return true;
            }
            let woken = self.answered.wait_timeout(stamp, left.min(SLICE));
            let answered = woken.unwrap_or_else(PoisonError::into_inner).0.is_none();
            if answered {
                return true;
            }
            if left.is_zero() || !go_on() {
                return false;
            }
        }
    }
}

impl Lockstep {
    /// Starts pairs of topics: a played one, and one with replies of the same stamp.
    ///
    /// # Errors
    /// If a topic is not played, or the replies have no publisher within `patience`.
    pub(super) fn start(
        pairs: &[String],
        played: &[String],
        node: &Node,
        patience: Duration,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Self, NodeError> {
        let mut lockstep = Self::default();
        let refused = |problem: String| node.params().invalid("lockstep", problem);
        for pair in pairs.chunks(2) {
            let (topic, answers) = match pair {
                [topic, answers] => (topic, node.resolve(answers)?),
                _ => return Err(refused("expected pairs of topics".to_owned()).into()),
            };
            let Some(index) = played.iter().position(|name| name == topic) else {
                return Err(refused(format!("'{topic}' is not played")).into());
            };
            let Some(publisher) = publisher_of(&answers, node, patience, go_on) else {
                let seconds = patience.as_secs();
                let problem = format!("no publisher on '{answers}' after {seconds} s");
                return Err(refused(format!("{problem} (`wait_timeout_s`)")).into());
            };
            let awaited = Arc::new(Awaited::default());
            let on_answer = {
                let awaited = Arc::clone(&awaited);
                move |cdr: Vec<u8>| awaited.answer(&cdr)
            };
            let of = publisher.type_name.as_str();
            let qos = qos_of(&publisher);
            let subscription = node.subscribe_raw(
                &answers,
                of,
                qos,
                SubscriptionExecutor::Dedicated,
                on_answer,
            )?;
            let pair = Pair {
                answers,
                awaited,
                given_up: false,
                _subscription: subscription,
            };
            lockstep.0.insert(index, pair);
        }
        Ok(lockstep)
    }

    /// Waits for the reply to the last message of a topic, then registers the next message. After a timeout the topic
    /// does not wait until a reply arrives.
    pub(super) fn before(
        &mut self,
        topic: usize,
        next: &[u8],
        patience: Duration,
        go_on: &mut dyn FnMut() -> bool,
    ) {
        let Some(pair) = self.0.get_mut(&topic) else {
            return;
        };
        let patience = match pair.given_up {
            true => Duration::ZERO,
            false => patience,
        };
        let answered = pair.awaited.wait(patience, go_on);
        if !answered && !pair.given_up && go_on() {
            let seconds = patience.as_secs_f64();
            log::warn!(
                "{}: no reply within {seconds} s (`max_wait_s`); lockstep is off until one arrives",
                pair.answers
            );
        }
        pair.given_up = !answered;
        *pair.awaited.lock() = stamp_of(next);
    }

    /// Waits for the replies to the last messages.
    pub(super) fn finish(&self, patience: Duration, go_on: &mut dyn FnMut() -> bool) {
        for pair in self.0.values().filter(|pair| !pair.given_up) {
            if !pair.awaited.wait(patience, go_on) {
                log::warn!("{}: no reply to the last message", pair.answers);
            }
        }
    }
}

/// First publisher of a topic in another process.
fn publisher_of(
    topic: &str,
    node: &Node,
    patience: Duration,
    go_on: &mut dyn FnMut() -> bool,
) -> Option<RemotePublisher> {
    let deadline = Instant::now() + patience;
    loop {
        let mut all = node.remote_publishers().into_iter();
        let found = all.find(|publisher| publisher.topic == topic);
        if found.is_some() || Instant::now() >= deadline || !go_on() {
            return found;
        }
        thread::sleep(SLICE);
    }
}

/// QoS offered by the publisher.
fn qos_of(publisher: &RemotePublisher) -> Qos {
    match (publisher.reliability, publisher.durability) {
        (Reliability::BestEffort, _) => Qos::best_effort(DEPTH),
        (Reliability::Reliable, Durability::Volatile) => Qos::reliable(DEPTH),
        (Reliability::Reliable, Durability::TransientLocal) => Qos::latched(DEPTH),
    }
}

/// Stamp (seconds and nanoseconds, little-endian) of a message that begins with a header.
fn stamp_of(cdr: &[u8]) -> Option<[u8; 8]> {
    let is_little = cdr.get(1)? & 1 == 1;
    let fields = cdr.get(ENCAPSULATION_BYTES..)?.first_chunk::<8>()?;
    let [a, b, c, d, e, f, g, h] = *fields;
    Some(match is_little {
        true => *fields,
        false => [d, c, b, a, h, g, f, e],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LITTLE: [u8; 14] = [0, 1, 0, 0, 7, 0, 0, 0, 9, 1, 0, 0, 42, 42];
    const BIG: [u8; 12] = [0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 1, 9];

    #[test]
    fn stamps_of_either_byte_order_are_one() {
        assert_eq!(stamp_of(&LITTLE), Some([7, 0, 0, 0, 9, 1, 0, 0]));
        assert_eq!(stamp_of(&LITTLE), stamp_of(&BIG));
        for length in 0..12 {
            assert_eq!(stamp_of(&BIG[..length]), None);
        }
    }

    #[test]
    fn only_the_answer_of_the_same_stamp_ends_the_wait() {
        let awaited = Awaited::default();
        let (mut always, mut never) = (|| true, || false);
        assert!(
            awaited.wait(Duration::ZERO, &mut always),
            "nothing is awaited"
        );
        *awaited.lock() = stamp_of(&LITTLE);
        let mut other = BIG;
        other[7] = 8;
        awaited.answer(&other);
        awaited.answer(&[]);
        assert!(!awaited.wait(Duration::ZERO, &mut always));
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| awaited.wait(Duration::from_secs(600), &mut always));
            awaited.answer(&BIG);
            assert!(waiting.join().unwrap());
        });
        *awaited.lock() = stamp_of(&LITTLE);
        assert!(!awaited.wait(Duration::from_secs(600), &mut never));
    }
}
