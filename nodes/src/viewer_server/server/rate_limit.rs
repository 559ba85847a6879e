//! Rate limit of headset messages from one client.

use std::time::Instant;

/// Smallest charged message size, bytes.
const MIN_MESSAGE_BYTES: usize = 4096;

/// Token bucket in bytes, with the capacity of one second.
#[derive(Debug)]
pub struct RateLimit {
    bytes_per_s: f64,
    left: f64,
    at: Instant,
}

impl RateLimit {
    /// Full bucket of a new client.
    pub fn new(bytes_per_s: usize, now: Instant) -> Self {
        let bytes_per_s = bytes_per_s as f64;
        Self {
            bytes_per_s,
            left: bytes_per_s,
            at: now,
        }
    }

    /// True if a message of `bytes` is within the limit; it is then charged.
    pub fn admits(&mut self, bytes: usize, now: Instant) -> bool {
        let passed_s = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = now;
        self.left = (self.left + passed_s * self.bytes_per_s).min(self.bytes_per_s);
        let bytes = bytes.max(MIN_MESSAGE_BYTES) as f64;
        let fits = bytes <= self.left;
        if fits {
            self.left -= bytes;
        }
        fits
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_second_of_bytes_may_come_at_once_and_then_as_time_goes() {
        let start = Instant::now();
        let after = |ms: u64| start + Duration::from_millis(ms);
        let mut rate_limit = RateLimit::new(100_000, start);
        assert!(rate_limit.admits(90_000, start));
        assert!(
            !rate_limit.admits(20_000, start),
            "refused and not taken off"
        );
        assert!(rate_limit.admits(10_000, start));
        assert!(!rate_limit.admits(20_000, after(100)));
        assert!(rate_limit.admits(20_000, after(200)));
        // Short messages count, too, and an hour brings no more than a second's worth.
        let hour = after(3_600_000);
        assert_eq!((0..100).filter(|_| rate_limit.admits(1, hour)).count(), 24);
        // A clock that goes back brings nothing.
        assert!(!rate_limit.admits(5000, start));
        assert!(!rate_limit.admits(200_000, after(7_200_000)));
    }
}
