//! Time that remains.

use std::time::{Duration, Instant};

use crate::progress::Progress;

/// Progress of an evaluation with the time that is left.
pub(super) struct Remaining {
    bar: Progress,
    started: Instant,
}

impl Remaining {
    pub fn new() -> Remaining {
        Remaining {
            bar: Progress::new("evaluate"),
            started: Instant::now(),
        }
    }

    /// Says how many trials are done, of all.
    pub fn tell(&self, done: usize, total: usize) {
        self.bar.set(done as f64 / total.max(1) as f64);
        let share = total.saturating_sub(done) as f64 / done.max(1) as f64;
        let left = clock(self.started.elapsed().mul_f64(share));
        self.bar.say(&format!("{done} of {total}, {left} left"));
    }

    pub fn done(self) {
        self.bar.done();
    }
}

pub(super) fn clock(time: Duration) -> String {
    let seconds = time.as_secs();
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours}:{minutes:02}:{:02}", seconds % 60)
}
