//! Colours that a sensor makes of light: exposure, white balance, vignetting, noise.

use super::light::Light;
use super::optics::RoomCamera;
use super::pattern::hash;
use crate::simulate::random::{Purpose, Stream};

/// Darkest mean light that the exposure makes up for.
const DARKEST: f32 = 0.01;

/// sRGB bytes of an image of light, row by row.
pub(super) fn developed(camera: &RoomCamera, light: &[Light], seed: u64) -> Vec<u8> {
    let mut stream = Stream::new(seed, Purpose::Exposure, 0, 0);
    // What is brighter than white does not darken all else.
    let mean = light.iter().map(|l| f64::from((l.sum() / 3.0).min(2.0)));
    let mean = mean.sum::<f64>() / light.len().max(1) as f64;
    let missed = (camera.exposure_spread * stream.normal() as f32).exp();
    let gain = camera.exposure * missed / (mean as f32).max(DARKEST);
    let balance = camera.balance * (2.0 * stream.uniform() as f32 - 1.0);
    let gains = Light::new(1.0 + balance, 1.0, 1.0 - balance) * gain;
    let noise_seed = (stream.uniform() * f64::from(u32::MAX)) as u32;
    let [width, height] = [camera.width, camera.height].map(|side| side as f32);
    let corner = (width * width + height * height) / 4.0;
    let mut bytes = Vec::with_capacity(3 * light.len());
    for (pixel, light) in light.iter().enumerate() {
        let x = (pixel % camera.width.max(1)) as f32 + 0.5 - width / 2.0;
        let y = (pixel / camera.width.max(1)) as f32 + 0.5 - height / 2.0;
        let lost = camera.vignetting * (x * x + y * y) / corner;
        let light = light.component_mul(&gains) * (1.0 - lost);
        for (channel, value) in light.iter().enumerate() {
            let value = value.clamp(0.0, 1.0);
            let [black, full] = camera.noise;
            let sigma = (black * black + full * full * value).sqrt();
            let off = normal(hash([pixel as i32, channel as i32, 0], noise_seed));
            bytes.push(srgb(value + sigma * off));
        }
    }
    bytes
}

/// Nearly normal of mean 0 and variance 1: the sum of four uniform bytes.
fn normal(bits: u32) -> f32 {
    let sum: u32 = bits.to_le_bytes().map(u32::from).iter().sum();
    (sum as f32 / 255.0 - 2.0) * 1.732
}

fn srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let value = match linear <= 0.003_130_8 {
        true => 12.92 * linear,
        false => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
    };
    (value * 255.0).round() as u8
}
