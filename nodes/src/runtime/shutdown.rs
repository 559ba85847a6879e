//! One request to end, from a signal, a failure or the program itself.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::{Handle, Signals};

use super::sync::lock;

/// Asks a runtime to end, and tells whether it has been asked. Clones share the request.
#[derive(Clone, Default)]
pub struct Shutdown {
    inner: Arc<Inner>,
}

#[derive(Default)]
struct Inner {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    requested: bool,
    failed: Option<&'static str>,
}

impl Shutdown {
    /// Asks to end. Again has no effect.
    pub fn request(&self) {
        lock(&self.inner.state).requested = true;
        self.inner.changed.notify_all();
    }

    /// True once asked.
    pub fn is_requested(&self) -> bool {
        lock(&self.inner.state).requested
    }

    /// Blocks until asked.
    pub fn wait(&self) {
        let mut state = lock(&self.inner.state);
        while !state.requested {
            state = self
                .inner
                .changed
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Asks to end because a thread cannot go on.
    pub(crate) fn fail(&self, thread: &'static str) {
        lock(&self.inner.state).failed.get_or_insert(thread);
        self.request();
    }

    /// The thread that could not go on.
    pub(crate) fn failed_thread(&self) -> Option<&'static str> {
        lock(&self.inner.state).failed
    }
}

/// Turns SIGINT and SIGTERM into a request while it lives; a second signal ends the process at once.
pub(crate) struct SignalWatch {
    handle: Handle,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl SignalWatch {
    pub(crate) fn start(shutdown: Shutdown) -> std::io::Result<Self> {
        let mut signals = Signals::new([SIGINT, SIGTERM])?;
        let handle = signals.handle();
        let thread = std::thread::Builder::new()
            .name("signals".to_owned())
            .spawn(move || {
                for signal in signals.forever() {
                    if shutdown.is_requested() {
                        // Whoever signals twice does not want to wait for queues to drain.
                        let _ = signal_hook::low_level::emulate_default_handler(signal);
                    }
                    log::info!("signal {signal}: shutting down");
                    shutdown.request();
                }
            })?;
        Ok(Self {
            handle,
            thread: Some(thread),
        })
    }
}

impl Drop for SignalWatch {
    fn drop(&mut self) {
        self.handle.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_wakes_who_waits() {
        let shutdown = Shutdown::default();
        let waiting = shutdown.clone();
        let thread = std::thread::spawn(move || waiting.wait());
        assert!(!shutdown.is_requested());
        shutdown.request();
        thread.join().unwrap();
        assert!(shutdown.is_requested());
        assert_eq!(shutdown.failed_thread(), None);
    }

    #[test]
    fn a_signal_is_a_request() {
        let shutdown = Shutdown::default();
        let _watch = SignalWatch::start(shutdown.clone()).unwrap();
        signal_hook::low_level::raise(SIGTERM).unwrap();
        shutdown.wait();
    }
}
