//! Timers whose period can change.

use std::time::{Duration, Instant};

use smol::Task;
use smol::channel::{Receiver, Sender, unbounded};
use smol::future;

use crate::task_thread::TaskThread;

/// Shortest period of a timer.
const MIN_PERIOD: Duration = Duration::from_millis(1);

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
        let (sender, changes) = unbounded();
        let task = thread.spawn(tick(period, changes, callback));
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

async fn tick(mut period: Duration, changes: Receiver<Duration>, mut callback: impl FnMut()) {
    let next = |at: Instant, period: Duration| match period.is_zero() {
        true => None,
        false => at.checked_add(period.max(MIN_PERIOD)),
    };
    let mut due = next(Instant::now(), period);
    loop {
        let timer = async {
            match due {
                Some(at) => drop(smol::Timer::at(at).await),
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
                next(now(), period)
            }
            (None, at) => {
                callback();
                at.and_then(|at| next(at, period))
                    .map(|next| next.max(now()))
            }
        };
    }
}
