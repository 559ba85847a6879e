//! Samples of a reader that wait for its task: the last of them, as its history says.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::Ordering::Relaxed;
use std::task::Waker;

use futures::task::AtomicWaker;
use lattice_cyclone_sys::{dds_entity_t, dds_instance_handle_t};

use super::gaps::Gaps;
use super::sample::{Taken, take};
use crate::port::{EndpointId, ReaderLosses};
use crate::sync::lock;

/// Samples that were taken out of Cyclone as they came, and what is missing among them.
pub(super) struct Arrivals {
    depth: usize,
    inner: Mutex<Inner>,
    losses: ReaderLosses,
    waker: AtomicWaker,
}

#[derive(Default)]
struct Inner {
    waiting: VecDeque<Taken>,
    gaps: Gaps,
}

impl Arrivals {
    /// For a history of the last `depth` samples.
    pub(super) fn new(depth: usize) -> Self {
        Self {
            depth: depth.max(1),
            inner: Mutex::default(),
            losses: ReaderLosses::default(),
            waker: AtomicWaker::new(),
        }
    }

    /// Takes what the reader has, and wakes the task that waits for it. `writer` gives the GUID to a handle.
    pub(super) fn take_from(
        &self,
        reader: dds_entity_t,
        writer: impl Fn(dds_instance_handle_t) -> Option<EndpointId>,
    ) {
        let mut inner = lock(&self.inner);
        let Inner { waiting, gaps } = &mut *inner;
        while let Some(sample) = take(reader) {
            let (handle, number) = (sample.writer(), sample.number());
            if let Some(writer) = writer(handle).filter(|_| number > 0) {
                let missing = gaps.note(writer, handle, number);
                self.losses.on_network.fetch_add(missing, Relaxed);
            }
            if waiting.len() >= self.depth {
                let _ = waiting.pop_front();
                self.losses.overrun.fetch_add(1, Relaxed);
            }
            waiting.push_back(sample);
        }
        drop(inner);
        self.waker.wake();
    }

    /// The oldest sample that waits.
    pub(super) fn pop(&self) -> Option<Taken> {
        lock(&self.inner).waiting.pop_front()
    }

    /// Samples that will not come out of here.
    pub(super) fn losses(&self) -> &ReaderLosses {
        &self.losses
    }

    /// Has the next arrival wake a task.
    pub(super) fn register(&self, waker: &Waker) {
        self.waker.register(waker);
    }
}
