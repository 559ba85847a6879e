//! Received samples that wait for the task of a reader, bounded by the history depth.

use std::collections::VecDeque;
use std::iter;
use std::sync::Mutex;
use std::sync::atomic::Ordering::Relaxed;
use std::task::{Context, Poll};

use futures::task::AtomicWaker;

use super::port::ReaderLosses;
use crate::sync::lock;

/// Samples taken out of the transport on arrival. The transport overwrites its own history without a
/// report; here overwritten samples are counted.
pub(crate) struct Arrivals<T> {
    depth: usize,
    waiting: Mutex<VecDeque<T>>,
    losses: ReaderLosses,
    waker: AtomicWaker,
}

impl<T> Arrivals<T> {
    /// A queue for a history of `depth` samples.
    pub(crate) fn new(depth: usize) -> Self {
        Self {
            depth: depth.max(1),
            waiting: Mutex::default(),
            losses: ReaderLosses::default(),
            waker: AtomicWaker::new(),
        }
    }

    /// Takes samples from `next` until it returns `None`, and wakes the waiting task.
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

    /// Takes the oldest waiting sample.
    fn pop(&self) -> Option<T> {
        lock(&self.waiting).pop_front()
    }

    /// Counters of lost samples.
    pub(crate) fn losses(&self) -> &ReaderLosses {
        &self.losses
    }

    /// Takes the oldest waiting sample, or registers the task for the next one.
    pub(crate) fn poll_next(&self, context: &mut Context<'_>) -> Poll<T> {
        if let Some(sample) = self.pop() {
            return Poll::Ready(sample);
        }
        self.waker.register(context.waker());
        // A sample may have arrived before the waker was registered.
        self.pop().map_or(Poll::Pending, Poll::Ready)
    }
}
