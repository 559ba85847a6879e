//! Task of a subscription: delivers messages of DDS and of this process to one handler.

use std::any::Any;
use std::sync::Arc;

use smol::channel::{Receiver, Sender};
use smol::future::or;

use super::{Sample, Stats};
use crate::transport::local_bus::{AnyMessage, LocalEndpoint};
use crate::transport::port::SampleReader;

/// Consecutive messages of a task before it yields to others of its thread.
const MESSAGES_PER_TURN: u32 = 16;

/// Inputs of one subscription.
pub(crate) struct Source {
    pub reader: Box<dyn SampleReader>,
    /// See [`Intake::orders`].
    ///
    /// [`Intake::orders`]: super::Intake::orders
    pub orders: Receiver<Sender<()>>,
    pub local: Receiver<AnyMessage>,
    /// `None`: messages of this process are not delivered.
    pub _local: Option<LocalEndpoint>,
    /// Keeps `local` open without a local publisher.
    pub _sender: Sender<AnyMessage>,
    pub stats: Arc<Stats>,
}

impl Source {
    /// Passes messages to the handler until the task is dropped.
    pub(crate) async fn run<M: Any + Send + Sync>(self, mut handler: impl FnMut(Sample<'_, M>)) {
        let mut turn: u32 = 0;
        loop {
            turn = turn.wrapping_add(1);
            if turn.is_multiple_of(MESSAGES_PER_TURN) {
                smol::future::yield_now().await;
            }
            match self.next(turn.is_multiple_of(2)).await {
                SubscriptionEvent::Local(message) => give_shared(message, &mut handler),
                SubscriptionEvent::Remote(Ok(())) => {
                    handler(Sample::Cdr(&mut self.reader.bytes()));
                }
                SubscriptionEvent::Remote(Err(why)) => self.stats.not_decodable(&why),
                SubscriptionEvent::WorkOff(done) => {
                    for _ in 0..self.local.len() {
                        let message = self.local.try_recv();
                        message
                            .into_iter()
                            .for_each(|m| give_shared(m, &mut handler));
                    }
                    drop(done);
                }
                SubscriptionEvent::End => return,
            }
        }
    }

    /// Awaits the next event; local and remote messages alternate in priority.
    async fn next(&self, local_first: bool) -> SubscriptionEvent {
        let order = async {
            self.orders
                .recv()
                .await
                .map_or(SubscriptionEvent::End, SubscriptionEvent::WorkOff)
        };
        let local = async {
            self.local
                .recv()
                .await
                .map_or(SubscriptionEvent::End, SubscriptionEvent::Local)
        };
        let remote = async { SubscriptionEvent::Remote(self.reader.next().await.map(drop)) };
        if local_first {
            or(order, or(local, remote)).await
        } else {
            or(order, or(remote, local)).await
        }
    }
}

fn give_shared<M: Any + Send + Sync>(message: AnyMessage, handler: &mut impl FnMut(Sample<'_, M>)) {
    if let Ok(message) = message.downcast::<M>() {
        handler(Sample::Shared(message));
    }
}

enum SubscriptionEvent {
    WorkOff(Sender<()>),
    Local(AnyMessage),
    Remote(Result<(), String>),
    End,
}
