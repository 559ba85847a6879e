//! The task that looks after the participant: it hands events on, and makes a new participant when
//! the one that is no longer works.

use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::stream::BoxStream;
use rustdds::DomainParticipantStatusEvent;
use smol::Timer;
use smol::channel::Sender;
use smol::future::{or, pending};

use super::health::{Gap, Returns};
use super::lives::Lives;
use super::participant::Participant;
use crate::error::RuntimeError;
use crate::port::PortEvent;

/// Between two looks at the participant, and between two attempts to make one.
const PERIOD: Duration = Duration::from_millis(500);

/// Looks after the participants of a process.
pub(super) struct Supervisor {
    lives: Arc<Lives>,
    returns: Returns,
    out: Sender<PortEvent>,
}

type Events = BoxStream<'static, DomainParticipantStatusEvent>;

impl Supervisor {
    /// Events go to `out`.
    pub(super) fn new(lives: Arc<Lives>, out: Sender<PortEvent>) -> Self {
        Self {
            lives,
            returns: Returns::new(),
            out,
        }
    }

    /// Looks after the participants until the task is dropped.
    pub(super) async fn run(mut self) {
        let mut reason = match self.lives.participant() {
            Some(first) => {
                let events = first.events();
                self.watch(first, events).await
            }
            None => return,
        };
        loop {
            let started = Instant::now();
            self.lives.end();
            // No peer of the old participant is one of the new.
            self.tell(PortEvent::AllLost).await;
            self.returns.renewed();
            match self.renew().await {
                Ok((participant, events)) => {
                    self.tell(PortEvent::Renewed).await;
                    log::warn!(
                        "{reason}; the DDS participant and its endpoints were made anew in {:.0?} \
                         (renewal {})",
                        started.elapsed(),
                        self.lives.renewals()
                    );
                    reason = self.watch(participant, events).await;
                }
                Err(error) => {
                    log::error!("{reason}; no new DDS participant yet: {error}");
                    Timer::after(PERIOD).await;
                }
            }
        }
    }

    /// Hands events on until something is wrong with the participant; tells what.
    async fn watch(&mut self, participant: Arc<Participant>, mut events: Events) -> String {
        let mut looks = Timer::interval(PERIOD);
        let mut gap = Gap::new();
        loop {
            let look = async {
                looks.next().await;
                None
            };
            let event = async {
                match events.next().await {
                    Some(event) => Some(event),
                    None => pending().await,
                }
            };
            if let Some(event) = or(look, event).await {
                self.hear(&participant, event).await;
            } else if !participant.is_alive() {
                return "a thread of RustDDS has ended".to_owned();
            } else if let Some(gap) = gap.look() {
                return format!("the process was stopped or the machine asleep for {gap:.0?}");
            } else if self.returns.due(Instant::now()) {
                return "a peer that had timed out is back".to_owned();
            }
        }
    }

    /// Makes a participant with all endpoints, writers first: see [`super::probe`].
    async fn renew(&mut self) -> Result<(Arc<Participant>, Events), RuntimeError> {
        let participant = self.lives.renew()?;
        let mut events = participant.events();
        loop {
            let (writers_made, known) = self.lives.writers_known()?;
            let hear = async {
                while let Some(event) = events.next().await {
                    self.hear(&participant, event).await;
                }
            };
            or(known, hear).await;
            if self.lives.renew_readers(writers_made)? {
                return Ok((participant, events));
            }
        }
    }

    async fn hear(&mut self, participant: &Participant, event: DomainParticipantStatusEvent) {
        self.returns.hear(&event);
        let event = participant.port_event(event, |id| self.lives.known_id(id));
        if let Some(event) = event {
            self.tell(event).await;
        }
    }

    async fn tell(&self, event: PortEvent) {
        // Nobody listens at the end.
        let _ = self.out.send(event).await;
    }
}
