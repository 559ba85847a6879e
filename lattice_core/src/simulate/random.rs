//! Random streams that depend on nothing but seed, purpose and index.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// What a stream is for; streams of different purposes are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u64)]
pub(super) enum Purpose {
    /// Phases of the loader's vibration.
    Vibration = 1,
    /// Errors of the INS.
    Ins = 2,
    /// Range noise; one stream per scan. The lasers take `LaserRange + 0`, `+ 1` and `+ 2`.
    LaserRange = 16,
    /// Range noise of the 64-beam scanner of surveys; one stream per sweep.
    SpinRange = 32,
    /// Where the robot of a house stops.
    RobotPath = 48,
    /// Pose and noise of a view of the robot; one stream per view.
    RobotView = 49,
    /// Where one stands before an object; one stream per object.
    HeadsetStand = 50,
    /// Frame and gazes of a headset.
    HeadsetFrame = 51,
    /// Depth views of a headset; one stream per view.
    HeadsetView = 52,
    /// Labels of a gaze; one stream per gaze.
    HeadsetGaze = 53,
    /// Which regions are labelled wrongly, and as what.
    LabelFlips = 54,
    /// Labels of single points; one stream per block of points.
    PointFlips = 55,
    /// Books and clutter of a house.
    OwnHouse = 56,
}

/// A stream of uniform and normal numbers.
pub(super) struct Stream {
    generator: ChaCha8Rng,
    spare_normal: Option<f64>,
}

impl Stream {
    /// Stream number `index` (below 2^48) of a purpose; `lane` separates equal devices.
    pub(super) fn new(seed: u64, purpose: Purpose, lane: u64, index: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator
            .set_stream(((purpose as u64).wrapping_add(lane) << 48) | (index & 0xffff_ffff_ffff));
        Self {
            generator,
            spare_normal: None,
        }
    }

    /// Uniform in [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1u64 << 53) as f64;
        (self.generator.next_u64() >> 11) as f64 * SCALE
    }

    /// Standard normal (Box & Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare_normal.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare_normal = Some(radius * sin);
        radius * cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_have_mean_zero_and_variance_one() {
        let mut stream = Stream::new(7, Purpose::Ins, 0, 0);
        let n = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let value = stream.normal();
            sum += value;
            squares += value * value;
        }
        assert!((sum / n as f64).abs() < 0.015, "mean {}", sum / n as f64);
        assert!(
            (squares / n as f64 - 1.0).abs() < 0.02,
            "variance {}",
            squares / n as f64
        );
    }

    #[test]
    fn streams_differ_by_seed_purpose_lane_and_index() {
        let first = |seed, purpose, lane, index| Stream::new(seed, purpose, lane, index).uniform();
        let values = [
            first(1, Purpose::Ins, 0, 0),
            first(2, Purpose::Ins, 0, 0),
            first(1, Purpose::Vibration, 0, 0),
            first(1, Purpose::LaserRange, 0, 0),
            first(1, Purpose::LaserRange, 1, 0),
            first(1, Purpose::LaserRange, 1, 1),
        ];
        for (i, a) in values.iter().enumerate() {
            for b in &values[i + 1..] {
                assert_ne!(a, b);
            }
        }
        assert_eq!(first(1, Purpose::Ins, 0, 0), values[0]);
    }
}
