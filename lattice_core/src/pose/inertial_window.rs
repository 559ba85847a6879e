//! Means of an inertial sensor over windows of a second.

use nalgebra::Vector3;

/// Least length of a window, ns: vibration averages out.
const WINDOW_NS: i64 = 1_000_000_000;
/// Longest time between two samples of a window, ns.
const MAX_GAP_NS: i64 = 250_000_000;
/// Largest specific force that is a measurement, m/s².
const MAX_FORCE: f64 = 1000.0;
/// Largest turning rate that is a measurement, rad/s or °/s.
const MAX_RATE: f64 = 10_000.0;

/// Sample of an accelerometer and a gyroscope, in the axes of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialSample {
    /// Time, nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Specific force, gravity not removed, m/s²; `None` without accelerometer.
    pub force: Option<Vector3<f64>>,
    /// Turning rate, rad/s; `None` without gyroscope.
    pub rate: Option<Vector3<f64>>,
}

/// Means of the samples between two times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialWindow {
    /// Time of the first sample, ns.
    pub from_ns: i64,
    /// Time of the last sample, ns.
    pub to_ns: i64,
    /// Mean specific force, m/s².
    pub force: Option<Vector3<f64>>,
    /// Mean turning rate, rad/s.
    pub rate: Option<Vector3<f64>>,
}

impl InertialWindow {
    /// The means in other axes.
    pub fn turned(&self, turn: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            force: self.force.as_ref().map(&turn),
            rate: self.rate.as_ref().map(&turn),
            ..*self
        }
    }
}

/// Sums of the window that is open.
#[derive(Clone, Copy, Debug)]
struct Open {
    from_ns: i64,
    last: InertialSample,
    force: Option<Vector3<f64>>,
    rate: Option<Vector3<f64>>,
}

/// Averages samples over windows, in constant memory.
#[derive(Clone, Debug, Default)]
pub struct InertialWindows {
    open: Option<Open>,
}

impl InertialWindows {
    /// Adds a sample, and returns the window that it completes. A gap or a backward step of stamps begins a new window.
    pub fn on_sample(&mut self, sample: &InertialSample) -> Option<InertialWindow> {
        let sample = InertialSample {
            force: within(sample.force, MAX_FORCE),
            rate: within(sample.rate, MAX_RATE),
            ..*sample
        };
        let begin = Open {
            from_ns: sample.stamp_ns,
            last: sample,
            force: Some(Vector3::zeros()),
            rate: Some(Vector3::zeros()),
        };
        let Some(open) = &mut self.open else {
            self.open = Some(begin);
            return None;
        };
        let step_ns = sample.stamp_ns.saturating_sub(open.last.stamp_ns);
        if (-MAX_GAP_NS..=0).contains(&step_ns) {
            // Again, or out of order: the others do.
            return None;
        }
        if !(0..=MAX_GAP_NS).contains(&step_ns) {
            self.open = Some(begin);
            return None;
        }
        let step_s = step_ns as f64 * 1e-9;
        let add = |sum: &mut Option<Vector3<f64>>, from, to| {
            *sum = match (*sum, from, to) {
                (Some(sum), Some(from), Some(to)) => Some(sum + (from + to) * (0.5 * step_s)),
                _ => None,
            };
        };
        add(&mut open.force, open.last.force, sample.force);
        add(&mut open.rate, open.last.rate, sample.rate);
        open.last = sample;
        let length_ns = sample.stamp_ns.saturating_sub(open.from_ns);
        if length_ns < WINDOW_NS {
            return None;
        }
        let length_s = length_ns as f64 * 1e-9;
        let window = InertialWindow {
            from_ns: open.from_ns,
            to_ns: sample.stamp_ns,
            force: open.force.map(|sum| sum / length_s),
            rate: open.rate.map(|sum| sum / length_s),
        };
        self.open = Some(begin);
        Some(window)
    }
}

/// A measurement whose norm is a number up to a limit.
fn within(measured: Option<Vector3<f64>>, limit: f64) -> Option<Vector3<f64>> {
    measured.filter(|measured| measured.norm() <= limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(stamp_ns: i64, z: f64) -> InertialSample {
        InertialSample {
            stamp_ns,
            force: Some(Vector3::new(0.0, 0.0, z)),
            rate: Some(Vector3::new(0.0, 0.0, 0.1 * z)),
        }
    }

    fn windows(samples: impl IntoIterator<Item = InertialSample>) -> Vec<InertialWindow> {
        let mut windows = InertialWindows::default();
        let samples = samples.into_iter();
        samples
            .filter_map(|sample| windows.on_sample(&sample))
            .collect()
    }

    #[test]
    fn windows_have_the_mean_over_time() {
        // Stamps of uneven steps, of a force that grows with time.
        let stamps = (0..400_i64).map(|i| i * 10_000_000 + (i % 3) * 3_000_000);
        let found = windows(stamps.map(|at| sample(at, at as f64 * 1e-9)));
        assert_eq!(found.len(), 3);
        for window in found {
            let middle_s = 0.5e-9 * (window.from_ns + window.to_ns) as f64;
            assert!((window.force.unwrap().z - middle_s).abs() < 1e-9);
            assert!((window.rate.unwrap().z - 0.1 * middle_s).abs() < 1e-9);
        }
    }

    #[test]
    fn a_field_without_numbers_is_absent() {
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            let mut samples: Vec<_> = (0..110).map(|i| sample(i * 10_000_000, 9.8)).collect();
            samples[50].force = Some(Vector3::new(0.0, bad, 9.8));
            let found = windows(samples);
            assert_eq!((found.len(), found[0].force), (1, None));
            assert!(found[0].rate.is_some());
        }
    }

    #[test]
    fn gaps_and_backward_stamps_begin_a_new_window() {
        let steady = |from: i64| (0..90).map(move |i| sample(from + i * 10_000_000, 9.8));
        let gap = steady(0).chain(steady(2_000_000_000));
        assert_eq!(windows(gap), []);
        let back = steady(i64::MAX - 1_000_000_000).chain(steady(i64::MIN));
        assert_eq!(windows(back), []);
        // A sample that comes twice or late changes nothing.
        let twice = steady(0).flat_map(|one| [one, one, sample(one.stamp_ns - 5_000_000, 1e3)]);
        let after = steady(900_000_000).take(20);
        let found = windows(twice.chain(after));
        assert_eq!(found.len(), 1);
        assert!((found[0].force.unwrap().z - 9.8).abs() < 1e-9);
    }
}
