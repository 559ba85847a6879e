//! Points that are transformed together.

use nalgebra::{Isometry3, Vector3};

/// Range limits in the sensor frame: `min_range_m < distance <= max_range_m`.
///
/// The origin of the sensor, which many drivers send for a missing return, is always dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeLimits {
    /// Distance up to which points are dropped, metres.
    pub min_range_m: f64,
    /// Maximum distance, metres.
    pub max_range_m: f64,
}

impl Default for RangeLimits {
    fn default() -> RangeLimits {
        RangeLimits {
            min_range_m: 0.0,
            max_range_m: f64::INFINITY,
        }
    }
}

/// Points of a block.
pub(super) const LANES: usize = 16;

/// One number of each point of a block.
pub(super) type Lanes = [f64; LANES];

/// Vector of a lane.
#[inline(always)]
pub(super) fn at(vectors: &[Lanes; 3], lane: usize) -> Vector3<f64> {
    Vector3::from(vectors.map(|lanes| lanes.get(lane).copied().unwrap_or(f64::NAN)))
}

/// Points that are transformed together, each by its own pose; vectorized by the compiler.
#[derive(Default)]
pub(super) struct Block {
    pub(super) points_m: [Lanes; 3],
    distances_m: Lanes,
    /// Vector part and scalar of the rotation.
    rotation: [Lanes; 4],
    pub(super) translation_m: [Lanes; 3],
    pub(super) moved_m: [Lanes; 3],
}

impl Block {
    #[inline(always)]
    pub(super) fn set_pose(&mut self, lane: usize, pose: &Isometry3<f64>) {
        let [i, j, k, w] = pose.rotation.coords.into();
        for (lanes, value) in self.rotation.iter_mut().zip([i, j, k, w]) {
            lanes[lane % LANES] = value;
        }
        for (lanes, value) in self.translation_m.iter_mut().zip(&pose.translation.vector) {
            lanes[lane % LANES] = *value;
        }
    }

    /// Distances of the points from the sensor.
    #[inline(always)]
    pub(super) fn measure(&mut self) {
        let [x, y, z] = &self.points_m;
        for lane in 0..LANES {
            let squared = x[lane] * x[lane] + y[lane] * y[lane] + z[lane] * z[lane];
            self.distances_m[lane] = squared.sqrt();
        }
    }

    /// Bits of the finite ones of the first `lanes` points, and of those in range.
    #[inline(always)]
    pub(super) fn outcomes(&self, lanes: usize, range: &RangeLimits) -> (u32, u32) {
        let (mut finite, mut in_range) = (0_u32, 0_u32);
        for lane in 0..LANES {
            let distance_m = self.distances_m[lane];
            let is_in_range = distance_m > range.min_range_m && distance_m <= range.max_range_m;
            finite |= u32::from(distance_m.is_finite()) << lane;
            in_range |= u32::from(is_in_range) << lane;
        }
        let there = (1 << lanes) - 1;
        (finite & there, in_range & there)
    }

    /// Rotates and moves the points: the product of nalgebra's isometry and point, operation by operation.
    #[inline(always)]
    pub(super) fn transform(&mut self) {
        let [x, y, z] = &self.points_m;
        let [i, j, k, w] = &self.rotation;
        let [dx, dy, dz] = &self.translation_m;
        let [mx, my, mz] = &mut self.moved_m;
        for lane in 0..LANES {
            let (x, y, z) = (x[lane], y[lane], z[lane]);
            let (i, j, k, w) = (i[lane], j[lane], k[lane], w[lane]);
            let tx = (j * z - k * y) * 2.0;
            let ty = (k * x - i * z) * 2.0;
            let tz = (i * y - j * x) * 2.0;
            mx[lane] = tx * w + (j * tz - k * ty) + x + dx[lane];
            my[lane] = ty * w + (k * tx - i * tz) + y + dy[lane];
            mz[lane] = tz * w + (i * ty - j * tx) + z + dz[lane];
        }
    }
}
