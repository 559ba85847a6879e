//! The time nodes go by: that of the system, or the one on `/clock`.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::time::{SystemTime, UNIX_EPOCH};

use lattice_msgs::rosgraph_msgs;

use super::core::Core;
use super::error::RuntimeError;
use super::graph::NodeId;
use super::qos::Qos;
use super::subscription::{Load, Sample, Stats, Subscription};
use super::sync::lock;

/// Tells the time. Clones tell the same.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    sim_ns: Option<Arc<AtomicI64>>,
}

impl Clock {
    /// Nanoseconds since the Unix epoch; with simulated time 0 until the first message on `/clock`.
    pub fn now_ns(&self) -> i64 {
        match &self.sim_ns {
            Some(sim_ns) => sim_ns.load(Relaxed),
            None => system_ns(),
        }
    }

    /// True where `use_sim_time` is set.
    pub fn is_sim(&self) -> bool {
        self.sim_ns.is_some()
    }
}

fn system_ns() -> i64 {
    let elapsed = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(elapsed.as_nanos()).unwrap_or(i64::MAX)
}

/// Simulated time, one for all nodes of a runtime.
pub(crate) struct SimTime {
    clock: Clock,
    _subscription: Subscription,
}

impl Core {
    /// The clock on `topic`, subscribed to at the first call.
    pub(crate) fn sim_clock(
        self: &Arc<Self>,
        node: NodeId,
        topic: &str,
    ) -> Result<Clock, RuntimeError> {
        let mut sim = lock(&self.sim_time);
        if let Some(sim) = sim.as_ref() {
            return Ok(sim.clock.clone());
        }
        let now_ns = Arc::new(AtomicI64::new(0));
        let clock = Clock {
            sim_ns: Some(Arc::clone(&now_ns)),
        };
        // ros2-client's own subscription to /clock has a wrong type.
        let handler = move |sample: Sample<'_, rosgraph_msgs::Clock>, stats: &Arc<Stats>| {
            if let Some(message) = stats.decode(sample) {
                now_ns.store(message.clock.to_ns(), Relaxed);
            }
        };
        let subscription =
            self.subscribe(node, topic, &Qos::CLOCK, Load::Small, 1 << 10, handler)?;
        *sim = Some(SimTime {
            clock: clock.clone(),
            _subscription: subscription,
        });
        Ok(clock)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn system_time_goes_on_and_simulated_time_waits() {
        let clock = Clock::default();
        let first = clock.now_ns();
        assert!(first > 1_700_000_000_000_000_000 && clock.now_ns() >= first);
        assert!(!clock.is_sim());
        let sim = Clock {
            sim_ns: Some(Arc::default()),
        };
        assert_eq!((sim.now_ns(), sim.is_sim()), (0, true));
    }
}
