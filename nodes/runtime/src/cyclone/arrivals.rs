//! Samples of a reader that wait for its task: the last of them, as its history says.

use std::collections::VecDeque;
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::task::Waker;

use cyclors::{DDS_ANY_STATE, dds_entity_t, dds_instance_handle_t, dds_takecdr};
use futures::task::AtomicWaker;

use super::entity::check;
use super::sample::Serialised;
use crate::sync::lock;

/// Samples that were taken out of Cyclone as they came. Cyclone's own history would overwrite what nobody
/// takes without a word; here it is counted.
pub(super) struct Arrivals {
    depth: usize,
    waiting: Mutex<VecDeque<Arrival>>,
    overwritten: AtomicU64,
    waker: AtomicWaker,
}

/// A sample and the handle of its writer.
pub(super) struct Arrival {
    pub sample: Serialised,
    pub writer: dds_instance_handle_t,
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
        while let Some(arrival) = take(reader) {
            if waiting.len() >= self.depth {
                let _ = waiting.pop_front();
                let _ = self.overwritten.fetch_add(1, Relaxed);
            }
            waiting.push_back(arrival);
        }
        drop(waiting);
        self.waker.wake();
    }

    /// The oldest sample that waits.
    pub(super) fn pop(&self) -> Option<Arrival> {
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

/// The next sample of a reader.
fn take(reader: dds_entity_t) -> Option<Arrival> {
    loop {
        let mut sample = ptr::null_mut();
        let mut info = MaybeUninit::uninit();
        // SAFETY: room for one sample and its information.
        let taken =
            unsafe { dds_takecdr(reader, &mut sample, 1, info.as_mut_ptr(), DDS_ANY_STATE) };
        match check(taken) {
            Ok(0) => return None,
            Ok(_) => {}
            Err(words) => {
                // Only a reader that is gone fails; there will be no more samples.
                log::debug!("Cyclone DDS: {words}");
                return None;
            }
        }
        // SAFETY: one was taken, so both are there, and the reference is ours.
        let (info, sample) = unsafe { (info.assume_init(), Serialised::from_raw(sample)) };
        // Others say that writers have come or gone.
        if let Some(sample) = sample.filter(|_| info.valid_data) {
            let writer = info.publication_handle;
            return Some(Arrival { sample, writer });
        }
    }
}
