//! The task of a subscription: from DDS and from this process to one handler.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use smol::channel::{Receiver, Sender};
use smol::future::{or, pending};

use super::intake::Command;
use super::{Sample, Stats};
use crate::local_bus::{AnyMessage, LocalEndpoint};
use crate::port::{EndpointId, Origin, SampleId, SampleReader};

/// After so many messages in a row, a task lets the others of its thread have a turn.
const MESSAGES_PER_TURN: u32 = 16;

/// Writers whose last sample is remembered.
const MAX_WRITERS: usize = 1024;

/// Everything one subscription hears.
pub(crate) struct Source {
    pub commands: Receiver<Command>,
    pub local: Receiver<AnyMessage>,
    /// None: what this process publishes is not heard.
    pub _local: Option<LocalEndpoint>,
    /// Keeps `local` open where no publisher has it.
    pub _sender: Sender<AnyMessage>,
    pub stats: Arc<Stats>,
}

impl Source {
    /// Gives messages to the handler until the task is dropped.
    pub(crate) async fn run<M: Any + Send + Sync>(self, mut handler: impl FnMut(Sample<'_, M>)) {
        let mut turn: u32 = 0;
        let mut gaps = Gaps::default();
        let mut reader: Option<Box<dyn SampleReader>> = None;
        loop {
            turn = turn.wrapping_add(1);
            if turn.is_multiple_of(MESSAGES_PER_TURN) {
                smol::future::yield_now().await;
            }
            match self.next(reader.as_deref(), turn.is_multiple_of(2)).await {
                Heard::Local(message) => give_shared(message, &mut handler),
                Heard::Remote(Ok(origin)) => {
                    let gap = gaps.before(origin.sample);
                    self.stats.lost.fetch_add(gap, Relaxed);
                    if let Some(reader) = &reader {
                        self.stats.lost.fetch_add(reader.missed(), Relaxed);
                        handler(Sample::Cdr(&mut reader.bytes()));
                    }
                }
                Heard::Remote(Err(why)) => self.stats.not_decodable(&why),
                Heard::Command(Command::Use(new)) => reader = Some(new),
                Heard::Command(Command::Close(done)) => {
                    reader = None;
                    drop(done);
                }
                Heard::Command(Command::WorkOff(done)) => {
                    for _ in 0..self.local.len() {
                        let message = self.local.try_recv();
                        message
                            .into_iter()
                            .for_each(|m| give_shared(m, &mut handler));
                    }
                    drop(done);
                }
                Heard::End => return,
            }
        }
    }

    /// Both sides get their turn, whichever has more to say.
    async fn next(&self, reader: Option<&dyn SampleReader>, local_first: bool) -> Heard {
        let command = async {
            self.commands
                .recv()
                .await
                .map_or(Heard::End, Heard::Command)
        };
        let local = async { self.local.recv().await.map_or(Heard::End, Heard::Local) };
        let remote = async {
            match reader {
                Some(reader) => Heard::Remote(reader.next().await),
                None => pending().await,
            }
        };
        if local_first {
            or(command, or(local, remote)).await
        } else {
            or(command, or(remote, local)).await
        }
    }
}

fn give_shared<M: Any + Send + Sync>(message: AnyMessage, handler: &mut impl FnMut(Sample<'_, M>)) {
    if let Ok(message) = message.downcast::<M>() {
        handler(Sample::Shared(message));
    }
}

enum Heard {
    Command(Command),
    Local(AnyMessage),
    Remote(Result<Origin, String>),
    End,
}

/// Finds the samples that a writer numbered and we never saw.
#[derive(Default)]
pub(crate) struct Gaps {
    last: BTreeMap<EndpointId, i64>,
}

impl Gaps {
    /// Samples missing between the one before and this one of the same writer.
    pub(crate) fn before(&mut self, sample: SampleId) -> u64 {
        let SampleId { writer, number } = sample;
        if self.last.len() >= MAX_WRITERS && !self.last.contains_key(&writer) {
            self.last.clear();
        }
        let last = self.last.entry(writer).or_insert(number.saturating_sub(1));
        let gap = number.saturating_sub(*last).saturating_sub(1);
        *last = number.max(*last);
        u64::try_from(gap).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_for_each_writer() {
        let [a, b] = [1, 2].map(|byte| EndpointId([byte; 16]));
        let mut gaps = Gaps::default();
        let mut before = |writer, number| gaps.before(SampleId { writer, number });
        let steps = [
            (a, 7, 0),
            (b, 1, 0),
            (a, 8, 0),
            (b, 5, 3),
            (a, 8, 0),
            (a, 7, 0),
            (a, 10, 1),
        ];
        for (writer, number, gap) in steps {
            assert_eq!(before(writer, number), gap, "{number}");
        }
        assert_eq!(before(a, i64::MAX), (i64::MAX - 11) as u64);
        assert_eq!(before(a, i64::MIN), 0);
    }
}
