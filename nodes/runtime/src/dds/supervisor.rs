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

/// Between an event and its news. RustDDS reports a match before it tells the reader where the numbers of
/// the writer begin; a sample that was written by then is history to a volatile reader of Cyclone.
const SETTLE_TIME: Duration = Duration::from_millis(20);

/// Looks after the participants of a process.
pub(super) struct Supervisor {
    lives: Arc<Lives>,
    returns: Returns,
    /// See [`Returns`].
    scout: Option<(Arc<Participant>, Events)>,
    out: Sender<(Instant, PortEvent)>,
}

type Events = BoxStream<'static, DomainParticipantStatusEvent>;

/// Next thing to do.
enum Turn {
    Look,
    Event(DomainParticipantStatusEvent),
    Scouted(DomainParticipantStatusEvent),
}

async fn next(events: &mut Events) -> DomainParticipantStatusEvent {
    match events.next().await {
        Some(event) => event,
        None => pending().await,
    }
}

impl Supervisor {
    /// Events go to `out`.
    pub(super) fn new(lives: Arc<Lives>, out: Sender<(Instant, PortEvent)>) -> Self {
        Self {
            lives,
            returns: Returns::new(),
            scout: None,
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
                Turn::Look
            };
            let event = async { Turn::Event(next(&mut events).await) };
            let scouted = async {
                match &mut self.scout {
                    Some((_, events)) => Turn::Scouted(next(events).await),
                    None => pending().await,
                }
            };
            match or(look, or(event, scouted)).await {
                Turn::Event(event) => {
                    self.hear(&participant, event).await;
                    continue;
                }
                Turn::Scouted(event) => {
                    self.returns.hear_scout(&event);
                    continue;
                }
                Turn::Look => self.send_scout(),
            }
            if !participant.is_alive() {
                return "a thread of RustDDS has ended".to_owned();
            } else if let Some(gap) = gap.look() {
                return format!("the process was stopped or the machine asleep for {gap:.0?}");
            } else if self.returns.due(Instant::now()) {
                return "a peer that had timed out is back, or away for long".to_owned();
            }
        }
    }

    /// Makes a scout if one is needed.
    fn send_scout(&mut self) {
        if self.returns.scout_due(Instant::now()) {
            self.scout = None;
            match self.lives.spare() {
                Ok(scout) => {
                    let events = scout.events();
                    self.scout = Some((Arc::new(scout), events));
                }
                Err(error) => log::debug!("no scout: {error}"),
            }
        }
    }

    /// Makes a participant with all endpoints, writers first: see [`super::probe`].
    async fn renew(&mut self) -> Result<(Arc<Participant>, Events), RuntimeError> {
        let scout = self.scout.take().filter(|_| self.returns.scout_is_fresh());
        let scout = scout.map(|(scout, _)| scout);
        self.returns.renewed();
        let participant = self.lives.renew(scout.filter(|scout| scout.is_alive()))?;
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
        if let Some(event) = participant.port_event(event, &self.lives) {
            self.tell(event).await;
        }
    }

    async fn tell(&mut self, event: PortEvent) {
        let now = Instant::now();
        let due = now.checked_add(SETTLE_TIME).unwrap_or(now);
        // Nobody listens at the end.
        let _ = self.out.send((due, event)).await;
    }
}
