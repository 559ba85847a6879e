//! The time nodes go by: that of the system, or the one on `/clock`.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::time::{SystemTime, UNIX_EPOCH};

/// Time of the system, or simulated time. Clones show the same.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    sim_ns: Option<Arc<AtomicI64>>,
}

impl Clock {
    /// Simulated time, set from elsewhere.
    pub(crate) fn simulated(now_ns: Arc<AtomicI64>) -> Self {
        Self {
            sim_ns: Some(now_ns),
        }
    }

    /// Nanoseconds since the Unix epoch; with simulated time 0 until the first message on `/clock`.
    pub fn now_ns(&self) -> i64 {
        match &self.sim_ns {
            Some(sim_ns) => sim_ns.load(Relaxed),
            None => system_ns(),
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
        assert_eq!(Clock::simulated(Arc::default()).now_ns(), 0);
    }
}
