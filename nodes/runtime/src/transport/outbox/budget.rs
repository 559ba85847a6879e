//! Byte budget of the queue of one publisher.

use std::sync::Mutex;

use crate::sync::{Changed, lock};

/// Byte counter with a limit. One message always fits, of any length.
pub(crate) struct Budget {
    limit: usize,
    state: Mutex<State>,
    freed: Changed,
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
    /// Creates a budget of `limit` bytes.
    pub(crate) fn new(limit: usize) -> Self {
        Self {
            limit,
            state: Mutex::default(),
            freed: Changed::default(),
        }
    }

    /// Reserves `bytes` if they fit.
    pub(crate) fn try_take(&self, bytes: usize) -> bool {
        let mut state = lock(&self.state);
        let fits = state.fits(bytes, self.limit);
        if fits {
            state.used = state.used.saturating_add(bytes);
        }
        fits
    }

    /// Completes when `bytes` are reserved. False: closed meanwhile.
    pub(crate) async fn take(&self, bytes: usize) -> bool {
        let taken = || {
            let closed = lock(&self.state).closed;
            (closed || self.try_take(bytes)).then_some(!closed)
        };
        self.freed.until(taken).await
    }

    /// Completes when `bytes` fit and `has_place` is true, checked at each release, or when closed.
    pub(crate) async fn room(&self, bytes: usize, has_place: impl Fn() -> bool) {
        let fits = || {
            let state = lock(&self.state);
            (state.closed || state.fits(bytes, self.limit) && has_place()).then_some(())
        };
        self.freed.until(fits).await;
    }

    /// Releases `bytes`.
    pub(crate) fn give_back(&self, bytes: usize) {
        let mut state = lock(&self.state);
        state.used = state.used.saturating_sub(bytes);
        self.freed.notify();
    }

    /// Rejects further and pending reservations.
    pub(crate) fn close(&self) {
        lock(&self.state).closed = true;
        self.freed.notify();
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
        let thread = std::thread::spawn(move || smol::block_on(waiting.take(5)));
        budget.give_back(10);
        assert!(thread.join().unwrap());
        let waiting = Arc::clone(&budget);
        let thread = std::thread::spawn(move || smol::block_on(waiting.take(6)));
        budget.close();
        assert!(!thread.join().unwrap());
    }
}
