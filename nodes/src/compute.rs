//! Compute thread with a bounded inbox and a private rayon pool.
//!
//! Senders never block: a full inbox rejects the newest event, which the caller counts.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, SendTimeoutError, Sender, bounded};

use lattice_runtime::{Node, Runtime, Shutdown, Timer, run_catching_panics};

use crate::start::LAST_PIECE;

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
    /// Disconnected when the handler is dropped at the end of the thread.
    ended: Receiver<()>,
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

impl<E: Send + 'static> Compute<E> {
    /// Starts the thread. The handler runs inside the pool, one event at a time, in order; a
    /// panic requests shutdown of the process.
    pub fn spawn(
        name: &str,
        limits: ComputeLimits,
        shutdown: Shutdown,
        handler: impl FnMut(E) + Send + 'static,
    ) -> io::Result<Self> {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let threads = match limits.threads {
            0 => cores.saturating_sub(1).max(1),
            threads => threads,
        };
        let prefix = name.to_owned();
        // The compute thread is one of the pool: no event is handed to another thread and waited for.
        let pool = move || {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.thread_name(move |i| format!("{prefix} pool {i}"));
            pool.use_current_thread().build().map_err(io::Error::other)
        };
        let (sender, receiver) = bounded::<Item<E>>(limits.events.max(1));
        let bytes = Arc::new(AtomicUsize::new(0));
        let in_flight = Arc::clone(&bytes);
        let dropped = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&dropped);
        let (running, ended) = bounded::<()>(0);
        let (started, is_started) = bounded::<io::Result<()>>(1);
        let thread = thread::Builder::new()
            .name(format!("{name} compute"))
            .spawn(move || {
                let _running = running;
                let mut handler = handler;
                let pool = match pool() {
                    Ok(pool) => pool,
                    Err(error) => {
                        let _ = started.send(Err(error));
                        return;
                    }
                };
                let _ = started.send(Ok(()));
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
        is_started.recv().map_err(io::Error::other)??;
        Ok(Self {
            inbox: Inbox {
                sender,
                bytes,
                max_bytes: limits.bytes,
            },
            thread: Some(thread),
            ended,
            dropped,
        })
    }

    /// Event sender; clones share the inbox.
    pub fn inbox(&self) -> Inbox<E> {
        self.inbox.clone()
    }

    /// As [`Compute::finish_with`], and calls `hurry` if that takes longer than `patience`. A thread that has not ended
    /// [`LAST_PIECE`] later is abandoned with an error in the log.
    pub fn finish_within(self, last: E, patience: Duration, hurry: impl FnOnce()) {
        self.finish(last, Some(patience), hurry, Some(LAST_PIECE));
    }

    /// As [`Compute::finish_with`], and calls `hurry` if that takes longer than `patience`.
    pub fn finish_hurrying(self, last: E, patience: Duration, hurry: impl FnOnce()) {
        self.finish(last, Some(patience), hurry, None);
    }

    /// Processes the queued events and a last one, then ends the thread.
    pub fn finish_with(self, last: E) {
        self.finish(last, None, || {}, None);
    }

    fn finish(
        mut self,
        last: E,
        patience: Option<Duration>,
        hurry: impl FnOnce(),
        rest: Option<Duration>,
    ) {
        let mut last = vec![None, Some((last, 0))];
        if !self.ends_within(&mut last, patience) {
            hurry();
            if !self.ends_within(&mut last, rest) {
                log::error!("the node ends in the middle of its work and without a report");
                return;
            }
        }
        let ended = self.thread.take().map(JoinHandle::join);
        if !last.is_empty() || ended.is_some_and(|ended| ended.is_err()) {
            log::error!("a compute thread panicked; its last results are lost");
        }
    }

    /// Sends the last events, from the end of the list on; true if the thread ends within this time.
    fn ends_within(&self, last: &mut Vec<Item<E>>, time: Option<Duration>) -> bool {
        let late = time.map(|time| Instant::now() + time);
        while let Some(item) = last.pop() {
            // Blocks for space, unlike other senders.
            let sender = &self.inbox.sender;
            let unsent = match late {
                Some(late) => sender.send_deadline(item, late).err(),
                None => sender
                    .send(item)
                    .err()
                    .map(|error| SendTimeoutError::Disconnected(error.0)),
            };
            if let Some(error) = unsent {
                let has_ended = error.is_disconnected();
                last.push(error.into_inner());
                return has_ended;
            }
        }
        let ended = match late {
            Some(late) => self.ended.recv_deadline(late),
            None => self
                .ended
                .recv()
                .map_err(|_| RecvTimeoutError::Disconnected),
        };
        ended == Err(RecvTimeoutError::Disconnected)
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

    /// Timer that sends an event in each period, and rests as [`Runtime::resting_timer`]. A full inbox gets the event in the
    /// next period.
    pub fn ticks(
        &self,
        (runtime, node): (&Runtime, &Node),
        period: Duration,
        event: impl Fn() -> E + Send + 'static,
    ) -> Timer
    where
        E: Send + 'static,
    {
        let (inbox, activity) = (self.clone(), node.activity());
        runtime.resting_timer(period, move || {
            if !inbox.send(event(), 0) {
                activity.note();
            }
        })
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
    fn the_thread_is_one_of_its_pool() {
        for threads in [1, 3] {
            let (done, results) = unbounded();
            let limits = ComputeLimits { threads, ..LIMITS };
            let worker = Compute::spawn("test", limits, Shutdown::default(), move |_: u32| {
                let name = thread::current().name().map(str::to_owned);
                let barrier = std::sync::Barrier::new(threads);
                // Ends only if so many threads are at work at once.
                rayon::broadcast(|_| barrier.wait());
                done.send((name, rayon::current_num_threads())).unwrap();
            });
            worker.unwrap().finish_with(0);
            let name = Some("test compute".to_owned());
            assert_eq!(results.recv(), Ok((name, threads)));
        }
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
    fn a_thread_that_does_not_end_is_abandoned() {
        for waiting in [0, 1, 7] {
            let (_go, wait) = unbounded::<()>();
            let worker = Compute::spawn("test", LIMITS, Shutdown::default(), move |_: u32| {
                let _ = wait.recv();
            })
            .unwrap();
            let inbox = worker.inbox();
            (0..waiting).for_each(|i| _ = inbox.send(i, 0));
            let mut hurried = false;
            worker.finish_within(9, Duration::ZERO, || hurried = true);
            assert!(hurried);
        }
    }

    #[test]
    fn a_thread_in_a_hurry_ends_after_its_last_event() {
        let (done, results) = unbounded();
        let (go, wait) = unbounded::<()>();
        let worker = Compute::spawn("test", LIMITS, Shutdown::default(), move |i: u32| {
            let _ = wait.recv();
            done.send(i).unwrap();
        })
        .unwrap();
        assert!(worker.inbox().send(1, 1));
        worker.finish_within(2, Duration::ZERO, || drop(go));
        assert_eq!(results.into_iter().collect::<Vec<_>>(), [1, 2]);
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
