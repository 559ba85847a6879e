//! Compute thread with a bounded inbox and a private rayon pool.
//!
//! Senders never block: a full inbox rejects the newest event, which the caller counts.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crossbeam_channel::{RecvTimeoutError, Sender, bounded};

use lattice_runtime::Shutdown;
use lattice_runtime::run_catching_panics;

/// Limits of a compute thread.
#[derive(Clone, Copy, Debug)]
pub struct ComputeLimits {
    /// Events in the inbox.
    pub events: usize,
    /// Stated bytes of the events in the inbox.
    pub bytes: usize,
    /// Threads of the pool; 0: one less than the number of cores, at least one.
    pub threads: usize,
}

/// An event with its bytes; `None` ends the thread.
type Item<E> = Option<(E, usize)>;

/// Runs a handler on a separate thread until finished. Dropping it discards queued events.
pub struct Compute<E> {
    inbox: Inbox<E>,
    thread: Option<JoinHandle<()>>,
    dropped: Arc<AtomicBool>,
}

/// Sender of events to a compute thread.
pub struct Inbox<E> {
    sender: Sender<Item<E>>,
    bytes: Arc<AtomicUsize>,
    max_bytes: usize,
}

impl<E> Clone for Inbox<E> {
    fn clone(&self) -> Self {
        Self {
            sender: self.sender.clone(),
            bytes: Arc::clone(&self.bytes),
            max_bytes: self.max_bytes,
        }
    }
}

/// Request to a compute thread to leave out work, since its node has to end.
#[derive(Clone, Debug, Default)]
pub struct Hurry(Arc<AtomicBool>);

impl Hurry {
    /// True after the request.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Requests it.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl<E: Send + 'static> Compute<E> {
    /// Starts the thread. The handler runs inside the pool, one event at a time, in order; a
    /// panic requests shutdown of the process.
    pub fn spawn(
        name: &str,
        limits: ComputeLimits,
        shutdown: Shutdown,
        mut handler: impl FnMut(E) + Send + 'static,
    ) -> io::Result<Self> {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let threads = match limits.threads {
            0 => cores.saturating_sub(1).max(1),
            threads => threads,
        };
        let prefix = name.to_owned();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(move |i| format!("{prefix} pool {i}"))
            .build()
            .map_err(io::Error::other)?;
        let (sender, receiver) = bounded::<Item<E>>(limits.events.max(1));
        let bytes = Arc::new(AtomicUsize::new(0));
        let in_flight = Arc::clone(&bytes);
        let dropped = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&dropped);
        let thread = thread::Builder::new()
            .name(format!("{name} compute"))
            .spawn(move || {
                run_catching_panics("compute", &shutdown, || {
                    while let Ok(Some((event, size))) = receiver.recv() {
                        if stop.load(Ordering::Acquire) {
                            break;
                        }
                        pool.install(|| handler(event));
                        in_flight.fetch_sub(size, Ordering::Relaxed);
                    }
                });
            })?;
        Ok(Self {
            inbox: Inbox {
                sender,
                bytes,
                max_bytes: limits.bytes,
            },
            thread: Some(thread),
            dropped,
        })
    }

    /// Event sender; clones share the inbox.
    pub fn inbox(&self) -> Inbox<E> {
        self.inbox.clone()
    }

    /// As [`Compute::finish_with`], and calls `hurry` if that takes longer than `patience`.
    pub fn finish_within(self, last: E, patience: Duration, hurry: impl FnOnce() + Send) {
        let (done, ended) = bounded::<()>(0);
        thread::scope(|scope| {
            scope.spawn(move || {
                if ended.recv_timeout(patience) == Err(RecvTimeoutError::Timeout) {
                    hurry();
                }
            });
            self.finish_with(last);
            drop(done);
        });
    }

    /// Processes the queued events and a last one, then ends the thread.
    pub fn finish_with(mut self, last: E) {
        // Blocks for space, unlike other senders.
        let sender = &self.inbox.sender;
        let sent = sender
            .send(Some((last, 0)))
            .and_then(|()| sender.send(None));
        let ended = self.thread.take().map(JoinHandle::join);
        if sent.is_err() | ended.is_some_and(|ended| ended.is_err()) {
            log::error!("a compute thread panicked; its last results are lost");
        }
    }
}

impl<E> Drop for Compute<E> {
    /// Ends the thread of a node that failed to start, even if its inbox is still in use.
    fn drop(&mut self) {
        if self.thread.is_some() {
            self.dropped.store(true, Ordering::Release);
            // If the inbox is full, the next event ends the thread.
            let _ = self.inbox.sender.try_send(None);
        }
    }
}

impl<E> Inbox<E> {
    /// Sends an event of `bytes`; `false`: the inbox is full, or the thread has ended.
    #[must_use]
    pub fn send(&self, event: E, bytes: usize) -> bool {
        let before = self.bytes.fetch_add(bytes, Ordering::Relaxed);
        // One event always fits an empty inbox, and events without bytes always fit.
        let fits = bytes == 0 || before == 0 || before.saturating_add(bytes) <= self.max_bytes;
        if fits && self.sender.try_send(Some((event, bytes))).is_ok() {
            return true;
        }
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
        false
    }

    /// Handler that sends each message as an event of its size, and counts rejected
    /// ones.
    pub fn counting<M, F: Fn(M) -> E>(
        &self,
        lost: &Arc<AtomicU64>,
        event: F,
        bytes: fn(&M) -> usize,
    ) -> impl FnMut(M) + use<E, M, F> {
        let (inbox, lost) = (self.clone(), Arc::clone(lost));
        move |message| {
            let bytes = bytes(&message);
            let sent = inbox.send(event(message), bytes);
            lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossbeam_channel::unbounded;

    const LIMITS: ComputeLimits = ComputeLimits {
        events: 2,
        bytes: 100,
        threads: 1,
    };

    #[test]
    fn works_off_in_order_before_it_ends() {
        let (done, results) = unbounded();
        let worker = Compute::spawn("test", LIMITS, Shutdown::default(), move |i: u32| {
            done.send(i).unwrap();
        })
        .unwrap();
        let inbox = worker.inbox();
        let mut sent = Vec::new();
        for i in 0..100 {
            if inbox.send(i, 1) {
                sent.push(i);
            }
        }
        worker.finish_with(100);
        sent.push(100);
        assert_eq!(results.into_iter().collect::<Vec<_>>(), sent);
        assert!(!inbox.send(7, 1), "an ended worker takes nothing");
    }

    #[test]
    fn a_dropped_worker_ends_though_its_inbox_is_held_and_full() {
        for waiting in 0..4 {
            let (_alive, ended) = unbounded::<()>();
            let (go, wait) = unbounded::<()>();
            let worker = Compute::spawn("test", LIMITS, Shutdown::default(), move |_: u32| {
                let _ = (&_alive, wait.recv());
            });
            let worker = worker.unwrap();
            let inbox = worker.inbox();
            (0..waiting).for_each(|i| _ = inbox.send(i, 0));
            drop(worker);
            drop(go);
            assert!(ended.recv().is_err(), "the handler is gone");
        }
    }

    #[test]
    fn a_panic_ends_the_process_in_good_order() {
        let shutdown = Shutdown::default();
        let compute = Compute::spawn("test", LIMITS, shutdown.clone(), |_: u32| {
            panic!("on purpose");
        })
        .unwrap();
        assert!(compute.inbox().send(1, 1));
        shutdown.wait();
        compute.finish_with(2);
    }

    #[test]
    fn a_full_inbox_refuses() {
        let (enter, entered) = unbounded();
        let (go, wait) = unbounded::<()>();
        let worker = Compute::spawn("test", LIMITS, Shutdown::default(), move |_: u32| {
            enter.send(()).unwrap();
            let _ = wait.recv();
        })
        .unwrap();
        let inbox = worker.inbox();
        assert!(inbox.send(0, 200), "alone, any size fits");
        entered.recv().unwrap();
        assert!(!inbox.send(1, 1), "bytes in work count");
        go.send(()).unwrap();
        drop(go);
        worker.finish_with(2);
    }
}
