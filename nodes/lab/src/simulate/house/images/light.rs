//! Light and colours.

use nalgebra::Vector3;

/// Red, green and blue, linear in the light.
pub(super) type Light = Vector3<f32>;

/// A colour of hue in degrees, saturation and value, both from 0 to 1; made linear.
pub(super) fn color(hue_deg: f64, saturation: f64, value: f64) -> Light {
    let channel = |n: f64| {
        let k = (n + hue_deg / 60.0).rem_euclid(6.0);
        let c = value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        c.powf(2.2) as f32
    };
    Light::new(channel(5.0), channel(3.0), channel(1.0))
}
