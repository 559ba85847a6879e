//! Clock of the playback.

use std::time::{Duration, Instant};

/// The player's clock, which stops while paused.
pub(super) struct Playhead {
    pub(super) begin: Instant,
    held: Option<Instant>,
}

impl Playhead {
    pub(super) fn new(held: bool) -> Self {
        let begin = Instant::now();
        Self {
            begin,
            held: held.then_some(begin),
        }
    }

    /// Restarts the clock, paused or not as before.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.is_held());
    }

    pub(super) fn is_held(&self) -> bool {
        self.held.is_some()
    }

    pub(super) fn now_ns(&self) -> i64 {
        let elapsed = self.held.map_or_else(
            || self.begin.elapsed(),
            |held| held.saturating_duration_since(self.begin),
        );
        i64::try_from(elapsed.as_nanos()).unwrap_or(i64::MAX)
    }

    pub(super) fn hold(&mut self) {
        let _ = self.held.get_or_insert_with(Instant::now);
    }

    /// Excludes a time that has passed from the clock.
    pub(super) fn stand(&mut self, passed: Duration) {
        if !self.is_held() {
            self.begin += passed;
        }
    }

    pub(super) fn go_on(&mut self) {
        if let Some(held) = self.held.take() {
            self.begin += held.elapsed();
        }
    }
}
