//! Scan of a lidar.

use nalgebra::Vector3;

use crate::cloud::NO_TIME_NS;

/// Scan in the frame of the base.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Points, metres.
    pub points_m: &'a [Vector3<f64>],
    /// Time of each point, ns; `None` if all are measured at the stamp.
    pub times_ns: Option<&'a [i64]>,
    /// Stamp, ns.
    pub stamp_ns: i64,
}

impl Scan<'_> {
    /// Times of the first and the last point, ns; the stamp without times.
    pub fn span_ns(&self) -> (i64, i64) {
        let times = self.times_ns.into_iter().flatten().copied();
        let known = times.filter(|time| *time != NO_TIME_NS);
        let span = known.fold(None, |span: Option<(i64, i64)>, time| {
            let (first, last) = span.unwrap_or((time, time));
            Some((first.min(time), last.max(time)))
        });
        span.unwrap_or((self.stamp_ns, self.stamp_ns))
    }
}
