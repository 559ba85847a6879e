//! Starts: the true pose, moved and turned by a given amount.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::random::mix;

/// The truth, moved by exactly `m` and turned by exactly `deg` about the vertical, either way, both at
/// `pivot_m` (headset frame).
///
/// Upright, as both frames are. Three quarters of the motion's variance are level: people guess their
/// height better than their place.
pub fn perturbed(
    truth: &Isometry3<f64>,
    pivot_m: &Point3<f64>,
    m: f64,
    deg: f64,
    seed: u64,
) -> Isometry3<f64> {
    let mut state = seed;
    let mut uniform = || (mix(&mut state) >> 11) as f64 / (1_u64 << 53) as f64;
    let heading = std::f64::consts::TAU * uniform();
    let lift = uniform() - 0.5;
    let side = if uniform() < 0.5 { -1.0 } else { 1.0 };
    let level = (1.0 - lift * lift).sqrt();
    let moved = Vector3::new(heading.cos() * level, heading.sin() * level, lift) * m;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * (side * deg.to_radians()));
    let place = Translation3::from((truth * pivot_m).coords);
    let moved_place = Translation3::from(place.vector + moved);
    moved_place * turn * place.inverse() * truth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of;

    #[test]
    fn starts_are_off_by_as_much_as_is_said_at_the_pivot() {
        let truth = Isometry3::new(Vector3::new(7.0, -2.0, 1.6), Vector3::z() * 2.5);
        let pivot = Point3::new(3.0, 4.0, 0.1);
        let mut sides = 0;
        for seed in 0..200 {
            let start = perturbed(&truth, &pivot, 0.8, 35.0, seed_of(&[seed, 2]));
            let moved = (start * pivot) - (truth * pivot);
            assert!((moved.norm() - 0.8).abs() < 1e-9 && moved.z.abs() <= 0.4 + 1e-9);
            let turn = (start.rotation * truth.rotation.inverse()).scaled_axis();
            assert!((turn.norm().to_degrees() - 35.0).abs() < 1e-9);
            assert!(turn.x.abs() < 1e-12 && turn.y.abs() < 1e-12);
            sides += i32::from(turn.z > 0.0);
        }
        assert!((70..=130).contains(&sides), "{sides}");
        assert_eq!(
            perturbed(&truth, &pivot, 0.0, 0.0, 1) * pivot,
            truth * pivot
        );
    }
}
