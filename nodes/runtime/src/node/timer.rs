//! Timers whose period can change.

use std::sync::LazyLock;
use std::time::{Duration, Instant};

use smol::Task;
use smol::channel::{Receiver, Sender, unbounded};
use smol::future;

use crate::activity::Activity;
use crate::task_thread::TaskThread;

/// Shortest period of a timer.
const MIN_PERIOD: Duration = Duration::from_millis(1);

/// Period of a resting timer: that of `/diagnostics`, for which nodes count in their callbacks.
const REST_PERIOD: Duration = Duration::from_secs(1);

/// A timer; dropping it ends it.
#[must_use = "dropping a timer ends it"]
pub struct Timer {
    /// `None` during shutdown.
    task: Option<Task<()>>,
    period: Sender<Duration>,
}

impl Timer {
    pub(crate) fn start(
        thread: &TaskThread,
        period: Duration,
        callback: impl FnMut() + Send + 'static,
    ) -> Self {
        Self::with(thread, period, Rest::Never, callback)
    }

    /// Timer that rests while nothing is noted: its callback is then called at whole seconds of the steady clock,
    /// as those of all such timers.
    pub(crate) fn start_resting(
        thread: &TaskThread,
        period: Duration,
        activity: Activity,
        callback: impl FnMut() + Send + 'static,
    ) -> Self {
        let rest = Rest::Without {
            activity,
            period: REST_PERIOD,
        };
        Self::with(thread, period, rest, callback)
    }

    fn with(
        thread: &TaskThread,
        period: Duration,
        rest: Rest,
        callback: impl FnMut() + Send + 'static,
    ) -> Self {
        let (sender, changes) = unbounded();
        let task = thread.spawn(tick(period, changes, rest, callback));
        Self {
            task,
            period: sender,
        }
    }

    /// Sets the period and restarts it; with zero the callback is not called.
    pub fn set(&self, period: Duration) {
        // Fails during shutdown.
        let _ = self.period.try_send(period);
    }

    /// Keeps it running until shutdown.
    pub fn detach(self) {
        if let Some(task) = self.task {
            task.detach();
        }
    }
}

/// Time at which a timer calls less often.
enum Rest {
    Never,
    /// While `activity` is unchanged the callback is called at multiples of `period`.
    Without {
        activity: Activity,
        period: Duration,
    },
}

impl Rest {
    /// Activity counted so far.
    fn count(&self) -> u64 {
        match self {
            Self::Never => 0,
            Self::Without { activity, .. } => activity.count(),
        }
    }

    /// Completes at `due` or, after a callback at `seen` activities, at the next whole rest period if there is no
    /// activity before.
    async fn over(&self, seen: Option<u64>, due: Instant) {
        if let (Self::Without { activity, period }, Some(seen)) = (self, seen) {
            let whole = next_multiple(*period, due);
            let rested = async {
                smol::Timer::at(whole).await;
            };
            future::or(activity.since(seen), rested).await;
        }
        smol::Timer::at(due).await;
    }
}

/// Start of the first timer of the process, from which rest periods are counted.
static ORIGIN: LazyLock<Instant> = LazyLock::new(Instant::now);

/// First multiple of `period` since [`ORIGIN`] that is not before `at`.
fn next_multiple(period: Duration, at: Instant) -> Instant {
    let (since, period) = (
        at.saturating_duration_since(*ORIGIN).as_nanos(),
        period.as_nanos(),
    );
    let wait = since.checked_next_multiple_of(period);
    let wait = wait.and_then(|multiple| u64::try_from(multiple - since).ok());
    let next = wait.and_then(|wait| at.checked_add(Duration::from_nanos(wait)));
    next.unwrap_or(at)
}

async fn tick(
    mut period: Duration,
    changes: Receiver<Duration>,
    rest: Rest,
    mut callback: impl FnMut(),
) {
    let next = |at: Instant, period: Duration| match period.is_zero() {
        true => None,
        false => at.checked_add(period.max(MIN_PERIOD)),
    };
    LazyLock::force(&ORIGIN);
    let mut due = next(Instant::now(), period);
    // Activity at the last callback.
    let mut seen = None;
    loop {
        let timer = async {
            match due {
                Some(at) => rest.over(seen, at).await,
                None => future::pending().await,
            }
            None
        };
        let change = async {
            match changes.recv().await {
                Ok(period) => Some(period),
                Err(_) => future::pending().await,
            }
        };
        let now = Instant::now;
        due = match (future::or(change, timer).await, due) {
            (Some(changed), _) => {
                period = changed;
                seen = None;
                next(now(), period)
            }
            (None, at) => {
                // Before the callback: what is noted meanwhile belongs to the next period.
                seen = Some(rest.count());
                callback();
                at.and_then(|at| next(at, period))
                    .map(|next| next.max(now()))
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use smol::channel::bounded;

    use super::*;
    use crate::shutdown::Shutdown;

    const PERIOD: Duration = Duration::from_millis(1);

    /// A rest that ends by activity alone.
    fn endless(activity: &Activity) -> Rest {
        Rest::Without {
            activity: activity.clone(),
            period: Duration::from_secs(1 << 30),
        }
    }

    #[test]
    fn a_timer_rests_until_activity() {
        let thread = TaskThread::start("test", Shutdown::default()).unwrap();
        let activity = Activity::default();
        let (sender, called) = unbounded();
        let resting = Timer::with(&thread, PERIOD, endless(&activity), move || {
            sender.try_send(()).unwrap();
        });
        called.recv_blocking().unwrap();
        let (sender, ticks) = bounded(50);
        let other = Timer::start(&thread, PERIOD, move || {
            let _ = sender.try_send(());
        });
        (0..50).for_each(|_| ticks.recv_blocking().unwrap());
        assert!(called.is_empty(), "it rests while others run");
        for _ in 0..3 {
            activity.note();
            called.recv_blocking().unwrap();
        }
        drop((resting, other));
    }

    #[test]
    fn activity_during_a_callback_is_followed_by_another_one() {
        let thread = TaskThread::start("test", Shutdown::default()).unwrap();
        let activity = Activity::default();
        let noted = activity.clone();
        let (sender, called) = unbounded();
        let mut left = 3;
        let _timer = Timer::with(&thread, PERIOD, endless(&activity), move || {
            if left > 0 {
                left -= 1;
                noted.note();
            }
            sender.try_send(left).unwrap();
        });
        let calls: Vec<_> = (0..4).map(|_| called.recv_blocking().unwrap()).collect();
        assert_eq!(calls, [2, 1, 0, 0]);
    }

    #[test]
    fn multiples_are_not_before_a_time_and_less_than_a_period_later() {
        let second = Duration::from_secs(1);
        let start = Instant::now();
        for ms in [0, 1, 999, 1000, 1001, 12_345] {
            let at = start + Duration::from_millis(ms);
            let multiple = next_multiple(second, at);
            assert!(multiple >= at && multiple < at + second);
            assert_eq!(next_multiple(second, multiple), multiple);
        }
    }
}
