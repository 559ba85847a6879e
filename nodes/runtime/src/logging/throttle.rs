use std::{
    sync::{
        LazyLock,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Lets a message through at most once per period, and counts the others.
///
/// Meant as a `static` beside the message; see [`crate::log_throttled`].
#[derive(Debug)]
pub struct Throttle {
    period_ns: u64,
    next_ns: AtomicU64,
    suppressed: AtomicU64,
}

impl Throttle {
    /// A throttle that lets its first message through.
    pub const fn new(period: Duration) -> Throttle {
        let period_ns = period.as_secs().saturating_mul(1_000_000_000);
        let period_ns = period_ns.saturating_add(period.subsec_nanos() as u64);
        Throttle {
            period_ns,
            next_ns: AtomicU64::new(0),
            suppressed: AtomicU64::new(0),
        }
    }

    /// Whether to log now: the messages suppressed since the last one, or `None`.
    pub fn check(&self) -> Option<u64> {
        self.check_at(u64::try_from(START.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    /// The same at a time of the caller's clock, ns.
    pub fn check_at(&self, now_ns: u64) -> Option<u64> {
        let next_ns = self.next_ns.load(Ordering::Relaxed);
        let after_ns = now_ns.saturating_add(self.period_ns);
        let ours = now_ns >= next_ns
            && self
                .next_ns
                .compare_exchange(next_ns, after_ns, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok();
        if ours {
            return Some(self.suppressed.swap(0, Ordering::Relaxed));
        }
        let _ = self.suppressed.fetch_add(1, Ordering::Relaxed);
        None
    }
}

/// Logs at most once per period at this place, with the number of messages left out.
///
/// `log_throttled!(log::Level::Warn, Duration::from_secs(5), "no pose for {stamp_ns}")`
#[macro_export]
macro_rules! log_throttled {
    ($level:expr, $period:expr, $($message:tt)+) => {{
        static THROTTLE: $crate::logging::Throttle =
            $crate::logging::Throttle::new($period);
        match THROTTLE.check() {
            Some(0) => log::log!($level, $($message)+),
            Some(more) => {
                log::log!($level, "{} ({more} more like this)", format_args!($($message)+))
            }
            None => {}
        }
    }};
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn one_message_per_period_and_a_count_of_the_rest() {
        let throttle = Throttle::new(Duration::from_millis(1));
        assert_eq!(throttle.check_at(5), Some(0));
        assert_eq!(throttle.check_at(5), None);
        assert_eq!(throttle.check_at(1_000_004), None);
        assert_eq!(throttle.check_at(1_000_005), Some(2));
        assert_eq!(throttle.check_at(2_000_005), Some(0));
    }

    #[test]
    fn threads_share_the_count() {
        let throttle = Throttle::new(Duration::MAX);
        let passed: usize = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4)
                .map(|_| scope.spawn(|| (0..1000).filter(|_| throttle.check().is_some()).count()))
                .collect();
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap())
                .sum()
        });
        assert_eq!(passed, 1);
        assert_eq!(throttle.suppressed.load(Ordering::Relaxed), 3999);
    }

    /// Keeps what is logged from this module.
    struct Memory(Mutex<Vec<String>>);

    impl log::Log for Memory {
        fn enabled(&self, _: &log::Metadata<'_>) -> bool {
            true
        }

        fn log(&self, record: &log::Record<'_>) {
            if record.target() == module_path!() {
                self.0.lock().unwrap().push(record.args().to_string());
            }
        }

        fn flush(&self) {}
    }

    #[test]
    fn the_macro_logs_once_per_period() {
        static MEMORY: Memory = Memory(Mutex::new(Vec::new()));
        log::set_logger(&MEMORY).unwrap();
        log::set_max_level(log::LevelFilter::Trace);
        for attempt in 0..3 {
            log_throttled!(log::Level::Warn, Duration::MAX, "one {attempt}");
        }
        for attempt in 0..2 {
            log_throttled!(log::Level::Warn, Duration::ZERO, "two {attempt}");
        }
        assert_eq!(*MEMORY.0.lock().unwrap(), ["one 0", "two 0", "two 1"]);
    }
}
