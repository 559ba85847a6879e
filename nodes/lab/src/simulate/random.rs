//! Random streams that depend on nothing but seed, purpose and index.

pub(super) use crate::random::Stream;

/// Purpose of a stream; streams of different purposes are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u64)]
pub(super) enum Purpose {
    Vibration = 1,
    Ins = 2,
    /// Range noise; one stream per scan. The lasers take `LaserRange + 0`, `+ 1` and `+ 2`.
    LaserRange = 16,
    /// Range noise of the 64-beam scanner of surveys; one stream per sweep.
    SpinRange = 32,
    RobotPath = 48,
    /// Pose and noise of a view of the robot; one stream per view.
    RobotView = 49,
    /// Stand before an object; one stream per object.
    HeadsetStand = 50,
    /// Frame and headset scans of a headset.
    HeadsetFrame = 51,
    /// Depth views of a headset; one stream per view.
    HeadsetView = 52,
    /// Labels of a headset scan; one stream per headset scan.
    HeadsetScan = 53,
    /// Regions that are labelled wrongly, and their wrong classes.
    LabelFlips = 54,
    GeneratedHouse = 56,
    LaserStand = 57,
    /// Range noise of a scan of the house; one stream per scan.
    LaserScan = 58,
    /// Materials of a house; one stream per thing.
    Materials = 59,
    Lamps = 60,
    /// Exposure and noise of an image.
    Exposure = 61,
    /// Views of someone who looks at things; one stream per view.
    LookView = 62,
    DepthNoise = 63,
    DrawnHouse = 64,
}

impl Stream {
    /// Stream number `index` (below 2^48) of a purpose; `lane` separates equal devices.
    pub(super) fn new(seed: u64, purpose: Purpose, lane: u64, index: u64) -> Self {
        let number = ((purpose as u64).wrapping_add(lane) << 48) | (index & 0xffff_ffff_ffff);
        Self::numbered(seed, number)
    }

    /// Uniform from `low` to `high`, in single precision.
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.uniform() as f32
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
        let [mean, variance] = [sum, squares].map(|sum| sum / n as f64);
        assert!(mean.abs() < 0.015, "{mean}");
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
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
        let bits: std::collections::BTreeSet<u64> = values.map(f64::to_bits).into();
        assert_eq!(bits.len(), values.len());
        assert_eq!(first(1, Purpose::Ins, 0, 0), values[0]);
    }
}
