//! Locks and notifications, used by all modules.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use smol::Timer;
use smol::channel::{Receiver, Sender, bounded};
use smol::future::or;

/// Locks, ignoring poison: the protected data are valid at every step.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Notification for any number of tasks and threads; each change wakes all of them.
#[derive(Default)]
pub(crate) struct Changed {
    waiting: Mutex<Vec<Sender<()>>>,
}

impl Changed {
    /// Wakes all waiters.
    pub(crate) fn notify(&self) {
        // Dropping the senders closes their receivers.
        lock(&self.waiting).clear();
    }

    /// Completes when `check` returns a value; checks now and after each change.
    pub(crate) async fn until<T>(&self, mut check: impl FnMut() -> Option<T>) -> T {
        loop {
            // Registered before the check, so that no change is missed.
            let change = self.register();
            if let Some(value) = check() {
                return value;
            }
            // Closes when the sender is dropped.
            let _ = change.recv().await;
        }
    }

    fn register(&self) -> Receiver<()> {
        let (sender, change) = bounded(1);
        let mut waiting = lock(&self.waiting);
        // Removes waiters that have given up.
        waiting.retain(|sender| !sender.is_closed());
        waiting.push(sender);
        change
    }
}

/// Waits until all senders of a channel are dropped. False: timeout.
pub(crate) fn wait_for(dropped: &Receiver<()>, deadline: Instant) -> bool {
    let late = async {
        Timer::at(deadline).await;
        false
    };
    smol::block_on(or(async { dropped.recv().await.is_err() }, late))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use futures::FutureExt;

    use super::*;

    #[test]
    fn one_change_wakes_all_who_wait() {
        let (changed, state) = (Changed::default(), &AtomicU32::new(0));
        let at_least = |n: u32| changed.until(move || (state.load(Relaxed) >= n).then_some(n));
        let (mut first, mut second) = (Box::pin(at_least(2)), Box::pin(at_least(1)));
        assert_eq!((&mut first).now_or_never(), None);
        assert_eq!((&mut second).now_or_never(), None);
        state.store(1, Relaxed);
        changed.notify();
        assert_eq!((&mut first).now_or_never(), None, "still waits");
        assert_eq!(second.now_or_never(), Some(1));
        drop(first);
        drop(changed.register());
        let waiting = lock(&changed.waiting).len();
        assert_eq!(waiting, 1, "those that went are forgotten");
    }
}
