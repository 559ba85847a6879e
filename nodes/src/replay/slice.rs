//! Part of a log.

use super::topics::TopicError;

/// Part of a log by log time, from its beginning.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Slice {
    /// The first log time, s.
    pub from_s: f64,
    /// The first log time behind it, s.
    pub to_s: f64,
}

impl Slice {
    /// The whole of a log.
    pub const WHOLE: Slice = Slice {
        from_s: 0.0,
        to_s: f64::INFINITY,
    };

    /// Bounds in log time, if they are in order.
    pub(super) fn range_ns(&self, start_ns: i64) -> Result<(i64, i64), TopicError> {
        // Not a number is refused too.
        if !(self.from_s >= 0.0 && self.from_s < self.to_s) {
            let (from_s, to_s) = (self.from_s, self.to_s);
            return Err(TopicError::Slice { from_s, to_s });
        }
        let at = |s: f64| start_ns.saturating_add((s * 1e9) as i64);
        Ok((at(self.from_s), at(self.to_s)))
    }
}
