//! Shutdown request of a process, by a signal, a failure or the program itself.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag::register_conditional_default;
use signal_hook::iterator::{Handle, Signals};
use signal_hook::low_level::emulate_default_handler;

use smol::Timer;
use smol::future::{block_on, or};

use super::sync::{Changed, lock};

/// Ignores SIGXFSZ: a write beyond the file size limit (`ulimit -f`) becomes an error instead of ending the process.
pub fn catch_file_size_signal() -> std::io::Result<()> {
    signal_hook::flag::register(SIGXFSZ, Arc::default()).map(drop)
}

/// Shutdown request shared by a runtime, its nodes and signals. Clones share the request.
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
    /// Number of files being written.
    writing: usize,
}

/// Guard of a file being written, which protects it from a second signal.
pub struct Writing(Shutdown);

impl Drop for Writing {
    fn drop(&mut self) {
        let mut state = lock(&self.0.inner.state);
        state.writing = state.writing.saturating_sub(1);
    }
}

impl Shutdown {
    /// Requests shutdown. Repeated calls have no effect.
    pub fn request(&self) {
        lock(&self.inner.state).requested = true;
        self.inner.changed.notify();
    }

    /// True after a request.
    pub fn is_requested(&self) -> bool {
        lock(&self.inner.state).requested
    }

    /// Blocks until a request.
    pub fn wait(&self) {
        block_on(self.requested());
    }

    /// Blocks until a request, or for `timeout`.
    pub fn wait_timeout(&self, timeout: Duration) {
        let late = async {
            Timer::after(timeout).await;
        };
        block_on(or(self.requested(), late));
    }

    /// Completes at a request.
    pub(crate) async fn requested(&self) {
        let check = || self.is_requested().then_some(());
        self.inner.changed.until(check).await;
    }

    /// Creates a guard for a file that a second signal must not interrupt.
    pub fn writing(&self) -> Writing {
        let mut state = lock(&self.inner.state);
        state.writing = state.writing.saturating_add(1);
        Writing(self.clone())
    }

    fn is_writing(&self) -> bool {
        lock(&self.inner.state).writing > 0
    }

    /// Requests shutdown because a thread has failed.
    pub(crate) fn fail(&self, thread: &'static str) {
        lock(&self.inner.state).failed.get_or_insert(thread);
        self.request();
    }

    /// The failed thread.
    pub(crate) fn failed_thread(&self) -> Option<&'static str> {
        lock(&self.inner.state).failed
    }
}

/// Number of signal watches; without one, signals have their default action.
static WATCHES: Mutex<usize> = Mutex::new(0);

/// True if a signal ends the process at once. `None`: the handler could not be registered.
static AT_ONCE: LazyLock<Option<Arc<AtomicBool>>> = LazyLock::new(|| {
    let at_once = Arc::new(AtomicBool::new(true));
    let registered = SIGNALS
        .iter()
        .all(|signal| register_conditional_default(*signal, Arc::clone(&at_once)).is_ok());
    registered.then_some(at_once)
});

const SIGNALS: [i32; 2] = [SIGINT, SIGTERM];

/// Time after the first signal in which a second one counts as the same request: `ros2 launch` without a
/// terminal sends two.
const SAME_REQUEST: Duration = Duration::from_secs(3);

fn set_at_once(value: bool) {
    if let Some(at_once) = AT_ONCE.as_ref() {
        at_once.store(value, Ordering::Relaxed);
    }
}

/// Signals received by a watch.
#[derive(Default)]
struct Had {
    first: Option<Instant>,
    second: bool,
}

/// Effect of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effect {
    /// Begin an orderly shutdown.
    Request,
    /// None: the shutdown is in progress.
    Wait,
    /// End the process at once.
    Kill,
}

impl Had {
    fn take(&mut self, now: Instant, is_writing: bool) -> Effect {
        let Some(first) = self.first else {
            self.first = Some(now);
            return Effect::Request;
        };
        let is_same = now.saturating_duration_since(first) < SAME_REQUEST;
        match !self.second && (is_same || is_writing) {
            true => {
                self.second = true;
                Effect::Wait
            }
            false => Effect::Kill,
        }
    }

    /// Time in which a second signal counts as the first; `None`: there was none, or two.
    fn left(&self, now: Instant) -> Option<Duration> {
        let first = self.first.filter(|_| !self.second)?;
        SAME_REQUEST.checked_sub(now.saturating_duration_since(first))
    }
}

/// Converts SIGINT and SIGTERM into shutdown requests while it exists. A third signal ends the process at once, as
/// does a late second one without a [`Writing`] guard.
pub(crate) struct SignalWatch {
    handle: Handle,
    had: Arc<Mutex<Had>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl SignalWatch {
    pub(crate) fn start(shutdown: Shutdown) -> std::io::Result<Self> {
        let mut watches = lock(&WATCHES);
        set_at_once(false);
        let mut signals = Signals::new(SIGNALS)?;
        let handle = signals.handle();
        let had: Arc<Mutex<Had>> = Arc::default();
        let taken = Arc::clone(&had);
        let thread = std::thread::Builder::new()
            .name("signals".to_owned())
            .spawn(move || {
                for signal in signals.forever() {
                    let effect = lock(&taken).take(Instant::now(), shutdown.is_writing());
                    // Logged last: logging may block.
                    match effect {
                        Effect::Request => {
                            shutdown.request();
                            log::info!("signal {signal}: shutting down");
                        }
                        Effect::Wait => {
                            set_at_once(true);
                            log::info!(
                                "signal {signal}: shutdown is in progress; the next signal ends the process"
                            );
                        }
                        Effect::Kill => drop(emulate_default_handler(signal)),
                    }
                }
            })?;
        *watches = watches.saturating_add(1);
        Ok(Self {
            handle,
            had,
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
        if *watches > 0 {
            return;
        }
        let left = lock(&self.had).left(Instant::now());
        // A second signal may come while the process ends.
        let later = left.map(|left| {
            let end = move || {
                std::thread::sleep(left);
                if *lock(&WATCHES) == 0 {
                    set_at_once(true);
                }
            };
            std::thread::Builder::new()
                .name("second signal".to_owned())
                .spawn(end)
        });
        if !matches!(later, Some(Ok(_))) {
            set_at_once(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader, Write};
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Command, ExitStatus, Stdio};

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
    fn a_second_signal_ends_nothing_if_it_is_soon_or_a_file_is_being_written() {
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs_f64(seconds);
        let effects = |second: (f64, bool), third: (f64, bool)| {
            let mut had = Had::default();
            [(0.0, false), second, third].map(|(at, writing)| had.take(after(at), writing))
        };
        let [request, wait, kill] = [Effect::Request, Effect::Wait, Effect::Kill];
        assert_eq!(effects((0.0, false), (0.0, true)), [request, wait, kill]);
        assert_eq!(effects((2.9, false), (60.0, true)), [request, wait, kill]);
        assert_eq!(effects((3.1, false), (3.1, false)), [request, kill, kill]);
        assert_eq!(effects((9.0, true), (9.1, true)), [request, wait, kill]);

        let mut had = Had::default();
        assert_eq!(had.left(start), None);
        had.take(start, false);
        assert_eq!(had.left(after(1.0)), Some(Duration::from_secs(2)));
        assert_eq!(had.left(after(3.1)), None);
        had.take(after(1.0), false);
        assert_eq!(had.left(after(1.0)), None, "the next one ends the process");

        let shutdown = Shutdown::default();
        let files = [shutdown.writing(), shutdown.clone().writing()];
        for file in files {
            assert!(shutdown.is_writing());
            drop(file);
        }
        assert!(!shutdown.is_writing());
    }

    /// A process that counts how often it has been signalled, and ends with its input.
    #[test]
    #[ignore = "started by the next test in a process of its own"]
    fn child() {
        log::set_logger(&ToStdout).unwrap();
        log::set_max_level(log::LevelFilter::Info);
        let shutdown = Shutdown::default();
        let _watch = SignalWatch::start(shutdown.clone()).unwrap();
        log::info!("ready");
        shutdown.wait();
        let _ = std::io::stdin().read_line(&mut String::new()).unwrap();
    }

    struct ToStdout;

    impl log::Log for ToStdout {
        fn enabled(&self, _: &log::Metadata<'_>) -> bool {
            true
        }

        fn log(&self, record: &log::Record<'_>) {
            let mut stdout = std::io::stdout();
            writeln!(stdout, "{}", record.args()).unwrap();
            stdout.flush().unwrap();
        }

        fn flush(&self) {}
    }

    /// Sends so many signals to a process, each when the one before has been taken note of.
    fn signalled(signals: usize) -> ExitStatus {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "shutdown::tests::child"])
            .args(["--ignored", "--nocapture"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut until = |text| {
            let mut lines = lines.by_ref().map(Result::unwrap);
            assert!(lines.any(|line| line.contains(text)), "{text}");
        };
        until("ready");
        let id = child.id().to_string();
        for signal in 0..signals {
            let kill = Command::new("kill").args(["-INT", &id]).status().unwrap();
            assert!(kill.success());
            match signal {
                0 => until("shutting down"),
                1 => until("shutdown is in progress"),
                _ => {}
            }
        }
        if signals == 2 {
            drop(child.stdin.take());
        }
        child.wait().unwrap()
    }

    #[test]
    fn the_third_signal_kills_and_not_the_second() {
        assert!(signalled(2).success());
        assert_eq!(signalled(3).signal(), Some(SIGINT));
    }

    #[test]
    fn a_signal_is_a_request() {
        let shutdown = Shutdown::default();
        let watch = SignalWatch::start(shutdown.clone()).unwrap();
        let at_once = AT_ONCE.as_ref().unwrap();
        signal_hook::low_level::raise(SIGTERM).unwrap();
        shutdown.wait();
        assert!(!at_once.load(Ordering::Relaxed), "the second one waits");
        drop(watch);
        let is_kill = at_once.load(Ordering::Relaxed);
        assert!(!is_kill, "a second one may come while the process ends");
        drop(SignalWatch::start(Shutdown::default()).unwrap());
        assert!(at_once.load(Ordering::Relaxed), "nobody watches");
        let _again = SignalWatch::start(Shutdown::default()).unwrap();
        assert!(!at_once.load(Ordering::Relaxed), "someone else does");
    }
}
