//! How many bytes may wait in the queue of one publisher.

use std::sync::{Condvar, Mutex, PoisonError};

use crate::sync::lock;

/// Counts bytes against a limit. One message always fits, however long.
pub(crate) struct Budget {
    limit: usize,
    state: Mutex<State>,
    freed: Condvar,
}

#[derive(Default)]
struct State {
    used: usize,
    closed: bool,
}

impl State {
    fn fits(&self, bytes: usize, limit: usize) -> bool {
        self.used == 0 || self.used.saturating_add(bytes) <= limit
    }
}

impl Budget {
    /// `limit` in bytes.
    pub(crate) fn new(limit: usize) -> Self {
        Self {
            limit,
            state: Mutex::default(),
            freed: Condvar::new(),
        }
    }

    /// Takes `bytes` if they fit.
    pub(crate) fn try_take(&self, bytes: usize) -> bool {
        let mut state = lock(&self.state);
        let fits = state.fits(bytes, self.limit);
        if fits {
            state.used = state.used.saturating_add(bytes);
        }
        fits
    }

    /// Waits until `bytes` fit and takes them. False: closed meanwhile.
    pub(crate) fn take_blocking(&self, bytes: usize) -> bool {
        let mut state = lock(&self.state);
        while !state.closed && !state.fits(bytes, self.limit) {
            state = self
                .freed
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
        if state.closed {
            return false;
        }
        state.used = state.used.saturating_add(bytes);
        true
    }

    /// Gives `bytes` back.
    pub(crate) fn give_back(&self, bytes: usize) {
        let mut state = lock(&self.state);
        state.used = state.used.saturating_sub(bytes);
        self.freed.notify_all();
    }

    /// Lets nobody wait any more.
    pub(crate) fn close(&self) {
        lock(&self.state).closed = true;
        self.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn one_long_message_fits_but_no_two() {
        let budget = Budget::new(10);
        assert!(budget.try_take(50));
        assert!(!budget.try_take(1));
        budget.give_back(50);
        assert!(budget.try_take(6));
        assert!(!budget.try_take(5));
        assert!(budget.try_take(4));
    }

    #[test]
    fn waiting_ends_with_room_or_closing() {
        let budget = Arc::new(Budget::new(10));
        assert!(budget.try_take(10));
        let waiting = Arc::clone(&budget);
        let thread = std::thread::spawn(move || waiting.take_blocking(5));
        budget.give_back(10);
        assert!(thread.join().unwrap());
        let waiting = Arc::clone(&budget);
        let thread = std::thread::spawn(move || waiting.take_blocking(6));
        budget.close();
        assert!(!thread.join().unwrap());
    }
}
