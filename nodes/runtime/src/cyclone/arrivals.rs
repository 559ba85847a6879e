//! Samples of a reader that wait for its task: the last of them, as its history says.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::task::Waker;

use futures::task::AtomicWaker;
use lattice_cyclone_sys::dds_entity_t;

use super::sample::{Taken, take};
use crate::sync::lock;

/// Samples that were taken out of Cyclone as they came. Cyclone's own history would overwrite what nobody
/// takes without a word; here it is counted.
pub(super) struct Arrivals {
    depth: usize,
    waiting: Mutex<VecDeque<Taken>>,
    overwritten: AtomicU64,
    waker: AtomicWaker,
}

impl Arrivals {
    /// For a history of the last `depth` samples.
    pub(super) fn new(depth: usize) -> Self {
        Self {
            depth: depth.max(1),
            waiting: Mutex::default(),
            overwritten: AtomicU64::new(0),
            waker: AtomicWaker::new(),
        }
    }

    /// Takes what the reader has, and wakes the task that waits for it.
    pub(super) fn take_from(&self, reader: dds_entity_t) {
        let mut waiting = lock(&self.waiting);
        while let Some(sample) = take(reader) {
            if waiting.len() >= self.depth {
                let _ = waiting.pop_front();
                let _ = self.overwritten.fetch_add(1, Relaxed);
            }
            waiting.push_back(sample);
        }
        drop(waiting);
        self.waker.wake();
    }

    /// The oldest sample that waits.
    pub(super) fn pop(&self) -> Option<Taken> {
        lock(&self.waiting).pop_front()
    }

    /// Samples that gave way to newer ones since the last call.
    pub(super) fn overwritten(&self) -> u64 {
        self.overwritten.swap(0, Relaxed)
    }

    /// Has the next arrival wake a task.
    pub(super) fn register(&self, waker: &Waker) {
        self.waker.register(waker);
    }
}
