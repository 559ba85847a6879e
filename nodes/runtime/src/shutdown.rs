//! One request to end, from a signal, a failure or the program itself.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register_conditional_default;
use signal_hook::iterator::{Handle, Signals};

use smol::Timer;
use smol::future::{block_on, or};

use super::sync::{Changed, lock};

/// A request to end that a runtime, its nodes and signals share. Clones are the same request.
#[derive(Clone, Default)]
pub struct Shutdown {
    inner: Arc<Inner>,
}

#[derive(Default)]
struct Inner {
    state: Mutex<State>,
    changed: Changed,
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
        self.inner.changed.notify();
    }

    /// True once asked.
    pub fn is_requested(&self) -> bool {
        lock(&self.inner.state).requested
    }

    /// Blocks until asked.
    pub fn wait(&self) {
        block_on(self.requested());
    }

    /// Blocks until asked, or for this long.
    pub fn wait_timeout(&self, timeout: Duration) {
        let late = async {
            Timer::after(timeout).await;
        };
        block_on(or(self.requested(), late));
    }

    /// Completes when asked.
    pub(crate) async fn requested(&self) {
        let check = || self.is_requested().then_some(());
        self.inner.changed.until(check).await;
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

/// Watches of this process; signals keep their default meaning while there is none.
static WATCHES: Mutex<usize> = Mutex::new(0);

/// True where a signal ends the process at once. `None`: the handler could not be registered.
static AT_ONCE: LazyLock<Option<Arc<AtomicBool>>> = LazyLock::new(|| {
    let at_once = Arc::new(AtomicBool::new(true));
    let registered = SIGNALS
        .iter()
        .all(|signal| register_conditional_default(*signal, Arc::clone(&at_once)).is_ok());
    registered.then_some(at_once)
});

const SIGNALS: [i32; 2] = [SIGINT, SIGTERM];

fn set_at_once(value: bool) {
    if let Some(at_once) = AT_ONCE.as_ref() {
        at_once.store(value, Ordering::Relaxed);
    }
}

/// Turns SIGINT and SIGTERM into a request while it lives; a second signal ends the process at once,
/// for who does not want to wait until queues have drained.
pub(crate) struct SignalWatch {
    handle: Handle,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl SignalWatch {
    pub(crate) fn start(shutdown: Shutdown) -> std::io::Result<Self> {
        let mut watches = lock(&WATCHES);
        set_at_once(false);
        let mut signals = Signals::new(SIGNALS)?;
        let handle = signals.handle();
        let thread = std::thread::Builder::new()
            .name("signals".to_owned())
            .spawn(move || {
                for signal in signals.forever() {
                    log::info!("signal {signal}: shutting down");
                    set_at_once(true);
                    shutdown.request();
                }
            })?;
        *watches = watches.saturating_add(1);
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
            // Its panic, if any, has been printed.
            let _ = thread.join();
        }
        let mut watches = lock(&WATCHES);
        *watches = watches.saturating_sub(1);
        if *watches == 0 {
            set_at_once(true);
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
        let watch = SignalWatch::start(shutdown.clone()).unwrap();
        signal_hook::low_level::raise(SIGTERM).unwrap();
        shutdown.wait();
        let at_once = AT_ONCE.as_ref().unwrap();
        assert!(
            at_once.load(Ordering::Relaxed),
            "a second one ends the process"
        );
        drop(watch);
        let _again = SignalWatch::start(Shutdown::default()).unwrap();
        assert!(
            !at_once.load(Ordering::Relaxed),
            "until someone else watches"
        );
    }
}
