//! Motion along a length that starts and ends at rest.

/// A smooth trapezoid of speed: the ramps are cubic, so that position is twice differentiable in time.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedProfile {
    length: f64,
    speed: f64,
    ramp_s: f64,
}

impl SpeedProfile {
    /// Covers `length` (>= 0) at no more than `max_speed` (units of length per second), each ramp taking `ramp_s`.
    pub(super) fn new(length: f64, max_speed: f64, ramp_s: f64) -> Self {
        Self {
            length,
            speed: max_speed.min(length / ramp_s),
            ramp_s,
        }
    }

    /// Duration, s.
    pub(super) fn duration_s(&self) -> f64 {
        if self.speed > 0.0 {
            self.length / self.speed + self.ramp_s
        } else {
            0.0
        }
    }

    /// Length covered and speed after `time_s`, held at the ends.
    pub(super) fn at(&self, time_s: f64) -> (f64, f64) {
        let duration_s = self.duration_s();
        if time_s <= 0.0 {
            (0.0, 0.0)
        } else if time_s >= duration_s {
            (self.length, 0.0)
        } else if time_s < self.ramp_s {
            self.ramp(time_s / self.ramp_s)
        } else if time_s > duration_s - self.ramp_s {
            let (covered, speed) = self.ramp((duration_s - time_s) / self.ramp_s);
            (self.length - covered, speed)
        } else {
            (self.speed * (time_s - 0.5 * self.ramp_s), self.speed)
        }
    }

    /// The ramp up at `u` in 0..1 of its duration: speed is the smoothstep 3u^2 - 2u^3, length its integral.
    fn ramp(&self, u: f64) -> (f64, f64) {
        let covered = self.speed * self.ramp_s * u * u * u * (1.0 - 0.5 * u);
        (covered, self.speed * u * u * (3.0 - 2.0 * u))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_is_the_derivative_of_length_and_stays_below_the_limit() {
        for (length, max_speed, ramp_s) in [(20.0, 1.5, 1.2), (0.7, 1.5, 1.2), (2.4, 0.8, 0.8)] {
            let profile = SpeedProfile::new(length, max_speed, ramp_s);
            let duration_s = profile.duration_s();
            let steps = 2000;
            for i in 0..=steps {
                let time_s = duration_s * f64::from(i) / f64::from(steps);
                let (_, speed) = profile.at(time_s);
                let h = 1e-6;
                let difference = (profile.at(time_s + h).0 - profile.at(time_s - h).0) / (2.0 * h);
                assert!(
                    (speed - difference).abs() < 1e-5,
                    "{time_s}: {speed} against {difference}"
                );
                assert!(speed <= max_speed + 1e-12);
            }
            assert_eq!(profile.at(duration_s).0, length);
        }
    }
}
