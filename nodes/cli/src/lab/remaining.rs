//! Time that remains.

use std::time::{Duration, Instant};

use crate::progress::Progress;

/// Runs an evaluation, and shows its progress with the time that is left.
pub(super) fn with_remaining<T>(run: impl FnOnce(&mut dyn FnMut(usize, usize)) -> T) -> T {
    let bar = Remaining::new();
    let ran = run(&mut |done, total| bar.tell(done, total));
    bar.bar.done();
    ran
}

struct Remaining {
    bar: Progress,
    started: Instant,
}

impl Remaining {
    fn new() -> Remaining {
        Remaining {
            bar: Progress::new("evaluate"),
            started: Instant::now(),
        }
    }

    /// Says how many trials are done, of all.
    fn tell(&self, done: usize, total: usize) {
        self.bar.set(done as f64 / total.max(1) as f64);
        let share = total.saturating_sub(done) as f64 / done.max(1) as f64;
        let left = clock(self.started.elapsed().mul_f64(share));
        self.bar.say(&format!("{done} of {total}, {left} left"));
    }
}

pub(super) fn clock(time: Duration) -> String {
    let seconds = time.as_secs();
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours}:{minutes:02}:{:02}", seconds % 60)
}
