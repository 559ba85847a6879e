//! Samples of a reader that wait for its task: the last of them, as its history says.

use std::collections::VecDeque;
use std::iter;
use std::sync::Mutex;
use std::sync::atomic::Ordering::Relaxed;
use std::task::{Context, Poll};

use futures::task::AtomicWaker;

use super::port::ReaderLosses;
use super::sync::lock;

/// Samples that were taken out of the transport as they came. Its own history would overwrite what nobody
/// takes without a word; here it is counted.
pub(crate) struct Arrivals<T> {
    depth: usize,
    waiting: Mutex<VecDeque<T>>,
    losses: ReaderLosses,
    waker: AtomicWaker,
}

impl<T> Arrivals<T> {
    /// For a history of the last `depth` samples.
    pub(crate) fn new(depth: usize) -> Self {
        Self {
            depth: depth.max(1),
            waiting: Mutex::default(),
            losses: ReaderLosses::default(),
            waker: AtomicWaker::new(),
        }
    }

    /// Takes what `next` gives until it gives no more, and wakes the task that waits for it.
    pub(crate) fn take_from(&self, next: impl FnMut() -> Option<T>) {
        let mut waiting = lock(&self.waiting);
        for sample in iter::from_fn(next) {
            if waiting.len() >= self.depth {
                let _ = waiting.pop_front();
                self.losses.overrun.fetch_add(1, Relaxed);
            }
            waiting.push_back(sample);
        }
        drop(waiting);
        self.waker.wake();
    }

    /// The oldest sample that waits.
    fn pop(&self) -> Option<T> {
        lock(&self.waiting).pop_front()
    }

    /// Samples that will not come out of here.
    pub(crate) fn losses(&self) -> &ReaderLosses {
        &self.losses
    }

    /// The oldest sample that waits, or the task is woken when the next comes.
    pub(crate) fn poll_next(&self, context: &mut Context<'_>) -> Poll<T> {
        if let Some(sample) = self.pop() {
            return Poll::Ready(sample);
        }
        self.waker.register(context.waker());
        // Something may have arrived before the waker was in place.
        self.pop().map_or(Poll::Pending, Poll::Ready)
    }
}
