//! Random numbers that are the same on every machine.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In a cube around 0.
    pub fn point(&mut self, half_side: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| (2.0 * self.unit() - 1.0) * half_side)
    }

    /// Below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// Uniform over all rotations.
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        loop {
            let v = self.point(1.0).push(2.0 * self.unit() - 1.0);
            let square = v.norm_squared();
            if square > 1e-4 && square < 1.0 {
                return UnitQuaternion::from_quaternion(Quaternion::from_vector(v));
            }
        }
    }
}
