//! Streams of random numbers that depend on nothing but a seed and a number, seeds of seeds, and uniform rotations.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// A stream of uniform and normal numbers.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: ChaCha8Rng,
    spare_normal: Option<f64>,
}

impl Stream {
    /// Stream `number` of a seed: independent of all others, the same wherever it is made.
    ///
    /// The simulation takes numbers from 2^48 to 2^55; others stay above or below.
    pub fn numbered(seed: u64, number: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(number);
        Self {
            generator,
            spare_normal: None,
        }
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1u64 << 53) as f64;
        (self.generator.next_u64() >> 11) as f64 * SCALE
    }

    /// Standard normal (Box & Muller 1958).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare_normal.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        self.spare_normal = Some(radius * sin);
        radius * cos
    }

    /// Each coordinate uniform in [0, 1).
    pub fn point(&mut self) -> Vector3<f64> {
        let [x, y, z] = [(); 3].map(|()| self.uniform());
        Vector3::new(x, y, z)
    }

    /// Uniform over all rotations; see [`arvo`].
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        arvo([(); 3].map(|()| self.uniform()))
    }
}

/// A rotation from three uniform numbers in [0, 1), uniform over all rotations (Arvo 1992, Fast random
/// rotation matrices): a turn about z, then half a turn about an axis that takes the pole anywhere.
pub fn arvo([turn, around, height]: [f64; 3]) -> UnitQuaternion<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), TAU * turn);
    let (sin, cos) = (TAU * around).sin_cos();
    let across = height.sqrt();
    let axis = Vector3::new(cos * across, sin * across, (1.0 - height).sqrt());
    UnitQuaternion::new_normalize(Quaternion::from_parts(0.0, axis)) * turn
}

/// The next number of SplitMix64 (Steele, Lea & Flood 2014).
pub(crate) fn mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A seed for a purpose, from others.
pub(crate) fn seed_of(parts: &[u64]) -> u64 {
    let mut state = 0;
    for part in parts {
        state = mix(&mut state) ^ part;
    }
    mix(&mut state)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_those_of_all_their_parts() {
        let parts: [&[u64]; 6] = [
            &[1, 0, 0],
            &[2, 0, 0],
            &[1, 1, 0],
            &[1, 0, 1],
            &[1, 0],
            &[0, 1],
        ];
        let seeds: std::collections::BTreeSet<u64> = parts.map(seed_of).into();
        assert_eq!(seeds.len(), parts.len());
        assert_eq!(seed_of(parts[0]), seed_of(&[1, 0, 0]));
    }

    #[test]
    fn rotations_are_uniform() {
        let mut stream = Stream::numbered(3, 0);
        let n = 40_000;
        let (mut pole, mut side, mut beyond) = (Vector3::zeros(), Vector3::zeros(), [0; 4]);
        let mut heights = [0; 10];
        for _ in 0..n {
            let rotation = stream.rotation();
            let up = rotation * Vector3::z();
            pole += up;
            side += rotation * Vector3::x();
            heights[((up.z + 1.0) * 5.0).min(9.0) as usize] += 1;
            for (count, angle) in beyond.iter_mut().zip([0.8_f64, 1.6, 2.4, 3.0]) {
                *count += usize::from(rotation.angle() > angle);
            }
        }
        assert!(pole.norm() / f64::from(n) < 0.015 && side.norm() / f64::from(n) < 0.015);
        // Archimedes: heights on a sphere are uniform.
        let even = heights.iter().all(|h| (3760..4240).contains(h));
        assert!(even, "{heights:?}");
        // The angle of a uniform rotation has the density (1 - cos) / pi.
        for (count, angle) in beyond.iter().zip([0.8_f64, 1.6, 2.4, 3.0]) {
            let share = 1.0 - (angle - angle.sin()) / std::f64::consts::PI;
            let found = *count as f64 / f64::from(n);
            assert!((found - share).abs() < 0.01, "{angle}: {found}");
        }
    }
}
