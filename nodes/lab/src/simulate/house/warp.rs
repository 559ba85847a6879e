//! Smooth errors in the shape of a headset's mesh.

use crate::simulate::random::Stream;
use nalgebra::{Point3, Vector3};

/// Waves a coordinate is shifted by.
const WAVES: usize = 3;

/// A smooth shift of all points, and a scale about the sensor.
#[derive(Clone, Debug)]
pub(super) struct Warp {
    /// Wave vector (rad/m), phase and amplitude (m) for each axis.
    waves: [[(Vector3<f64>, f64, f64); WAVES]; 3],
    scale: f64,
    about_m: Point3<f64>,
}

impl Warp {
    /// Shifts by up to `most_m` along each axis with wavelengths of 2 to 5 m.
    pub(super) fn new(most_m: f64, scale: f64, about_m: Point3<f64>, stream: &mut Stream) -> Warp {
        let mut wave = || {
            let direction = Vector3::from_fn(|_, _| stream.normal());
            let direction = direction.try_normalize(1e-9).unwrap_or(Vector3::x());
            let rate = std::f64::consts::TAU / (2.0 + 3.0 * stream.uniform());
            let phase = std::f64::consts::TAU * stream.uniform();
            (direction * rate, phase, most_m / WAVES as f64)
        };
        Warp {
            waves: [(); 3].map(|()| [(); WAVES].map(|()| wave())),
            scale,
            about_m,
        }
    }

    /// The warped point.
    pub(super) fn apply(&self, point_m: Point3<f64>) -> Point3<f64> {
        let scaled = self.about_m + (point_m - self.about_m) * self.scale;
        let shift = |axis: usize| {
            let waves = self.waves[axis].iter();
            waves
                .map(|(rate, phase, most_m)| most_m * (rate.dot(&point_m.coords) + phase).sin())
                .sum::<f64>()
        };
        scaled + Vector3::new(shift(0), shift(1), shift(2))
    }
}
