//! Time source of nodes: the system clock or `/clock`.

use std::sync::atomic::{AtomicBool, AtomicI64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::time::{SystemTime, UNIX_EPOCH};

/// System time or simulated time. Clones share one source.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    inner: Arc<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    is_simulated: AtomicBool,
    /// Set at the first switch to simulated time.
    sim_ns: OnceLock<Arc<AtomicI64>>,
}

impl Clock {
    /// Switches to simulated time, which the owner of `sim_ns` sets.
    pub(crate) fn simulate(&self, sim_ns: Arc<AtomicI64>) {
        let _ = self.inner.sim_ns.set(sim_ns);
        self.inner.is_simulated.store(true, Relaxed);
    }

    /// Switches to system time.
    pub(crate) fn follow_system(&self) {
        self.inner.is_simulated.store(false, Relaxed);
    }

    /// True for simulated time.
    pub(crate) fn is_simulated(&self) -> bool {
        self.inner.is_simulated.load(Relaxed)
    }

    /// Nanoseconds since the Unix epoch. Simulated time is 0 until the first message on `/clock`.
    pub fn now_ns(&self) -> i64 {
        match self.inner.sim_ns.get() {
            Some(sim_ns) if self.is_simulated() => sim_ns.load(Relaxed),
            _ => system_ns(),
        }
    }
}

fn system_ns() -> i64 {
    let elapsed = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(elapsed.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn system_time_goes_on_and_simulated_time_waits() {
        let clock = Clock::default();
        let first = clock.now_ns();
        assert!(first > 1_700_000_000_000_000_000 && clock.now_ns() >= first);
        let (sim_ns, same) = (Arc::<AtomicI64>::default(), clock.clone());
        clock.simulate(Arc::clone(&sim_ns));
        assert_eq!(same.now_ns(), 0);
        sim_ns.store(7, Relaxed);
        assert_eq!(same.now_ns(), 7);
        clock.follow_system();
        assert!(same.now_ns() >= first);
        clock.simulate(Arc::default());
        assert_eq!(same.now_ns(), 7, "one simulated time for all");
    }
}
