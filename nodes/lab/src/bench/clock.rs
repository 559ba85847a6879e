//! Wall and processor time of one operation.

use rustix::time::{ClockId, clock_gettime};
use std::time::Instant;

/// Time that an operation took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spent {
    /// Wall time, s.
    pub wall_s: f64,
    /// Processor time of all threads of the process, s.
    pub cpu_s: f64,
}

/// Runs an operation and measures its time.
pub fn timed<T>(operation: impl FnOnce() -> T) -> (T, Spent) {
    let (start, cpu_start_s) = (Instant::now(), process_cpu_s());
    let result = operation();
    let spent = Spent {
        cpu_s: process_cpu_s() - cpu_start_s,
        wall_s: start.elapsed().as_secs_f64(),
    };
    (result, spent)
}

/// Processor time of all threads of the process so far, s.
pub(super) fn process_cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_processor_time_and_sleep_does_not() {
        let (sum, work) = timed(|| (0..20_000_000u64).fold(0, |s, i| s ^ std::hint::black_box(i)));
        std::hint::black_box(sum);
        assert!(work.cpu_s > 0.5 * work.wall_s.min(0.002), "{work:?}");
        let ((), sleep) = timed(|| std::thread::sleep(std::time::Duration::from_millis(50)));
        assert!(sleep.wall_s >= 0.05 && sleep.cpu_s < 10.0, "{sleep:?}");
    }
}
