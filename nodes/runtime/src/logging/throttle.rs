use std::{
    sync::{
        LazyLock,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Rate limit of a log line: one message per period passes, the others are counted.
#[derive(Debug)]
pub struct Throttle {
    period_ns: u64,
    next_ns: AtomicU64,
    suppressed: AtomicU64,
}

impl Throttle {
    /// A throttle whose first message passes.
    pub const fn new(period: Duration) -> Throttle {
        let period_ns = period.as_secs().saturating_mul(1_000_000_000);
        let period_ns = period_ns.saturating_add(period.subsec_nanos() as u64);
        Throttle {
            period_ns,
            next_ns: AtomicU64::new(0),
            suppressed: AtomicU64::new(0),
        }
    }

    /// Number of messages suppressed since the last one, if a message may pass now.
    pub fn check(&self) -> Option<u64> {
        self.check_at(u64::try_from(START.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    fn check_at(&self, now_ns: u64) -> Option<u64> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
