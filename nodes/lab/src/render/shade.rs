//! Shading: the colours of faces on the screen.

use super::light::{Sun, openness};
use super::picture_options::RenderOptions;
use super::raster::{NOTHING, Scene, Screen};
use super::view::View;
use lattice_nodes::files::export::palette::srgb;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Samples a pixel in each direction.
pub(super) const SAMPLES: usize = 2;
/// Linear light of the sun, a little warm.
const SUN: [f64; 3] = [1.02, 0.98, 0.90];
/// Linear light of the open sky from above, a little blue.
const SKY: [f64; 3] = [0.50, 0.54, 0.60];
/// Part of the skylight that comes from below.
const FROM_BELOW: f64 = 0.45;
/// Darkening of edges.
const EDGE: f64 = 0.42;
/// Cells smaller than the first have no visible edges, from the second on full ones: samples.
const EDGES_FROM: [f64; 2] = [5.0, 16.0];

/// The picture as RGBA bytes, row by row from the top.
pub(super) fn picture(scene: &Scene, view: &View, options: &RenderOptions) -> Vec<u8> {
    let screen = scene.draw(view);
    let shader = Shader {
        sun: Sun::new(scene, options.azimuth_deg, view.size),
        normals: scene.normals(),
        palette: &scene.palette,
        contrast: options.contrast.clamp(0.0, 1.0),
        edge: EDGE * fraction(scene.radius_m * view.scale, EDGES_FROM),
        radius_m: scene.radius_m,
        screen: &screen,
        view,
    };
    let width = options.width as usize;
    let mut pixels = vec![0; width * options.height as usize * 4];
    pixels
        .par_chunks_mut(4)
        .enumerate()
        .for_each(|(index, pixel)| {
            let [column, row] = [index % width * SAMPLES, index / width * SAMPLES];
            let samples = (0..SAMPLES * SAMPLES).map(|i| [column + i % SAMPLES, row + i / SAMPLES]);
            let colors = samples.map(|at| shader.color(at));
            pixel.copy_from_slice(&mean(colors));
        });
    pixels
}

/// Place of `value` between two limits, 0 to 1.
fn fraction(value: f64, [low, high]: [f64; 2]) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

struct Shader<'a> {
    sun: Sun,
    normals: Vec<Vector3<f64>>,
    palette: &'a [[f64; 3]],
    edge: f64,
    contrast: f64,
    radius_m: f64,
    screen: &'a Screen,
    view: &'a View,
}

impl Shader<'_> {
    /// Linear colour of a sample, `None` where no face is.
    fn color(&self, [column, row]: [usize; 2]) -> Option<[f64; 3]> {
        let index = row * self.screen.width + column;
        let depth = self
            .screen
            .depth_m
            .get(index)
            .filter(|&&depth| depth != NOTHING)?;
        let surface = self.screen.surface.get(index)?;
        let normal = self.normals.get(usize::from(surface.face))?;
        let color = self.palette.get(usize::from(surface.tone))?;

        let at = [column as f64 + 0.5, row as f64 + 0.5, f64::from(*depth)];
        let facing = normal.dot(&self.sun.direction()).max(0.0);
        let sun = match facing > 0.0 {
            true => facing * self.sun.seen_from(&self.view.unproject(at), normal),
            false => 0.0,
        };
        let open = openness(self.screen, self.view, [column, row], normal, self.radius_m);
        let sky = open * (FROM_BELOW + (1.0 - FROM_BELOW) * 0.5 * (1.0 + normal.z));
        // Edges fade over two samples.
        let line = 1.0 - self.edge * (1.0 - f64::from(surface.inset) / 32.0).max(0.0);
        let light = SUN.iter().zip(SKY).map(|(s, a)| (s * sun + a * sky) * line);
        let light = light.map(|light| 1.0 + self.contrast * (light - 1.0));
        let mut lit = *color;
        lit.iter_mut().zip(light).for_each(|(c, light)| *c *= light);
        Some(lit)
    }
}

/// Mean of the samples of a pixel over white, as sRGB and opacity.
fn mean(samples: impl Iterator<Item = Option<[f64; 3]>>) -> [u8; 4] {
    let mut sum = [0.0; 3];
    for sample in samples {
        let color = sample.unwrap_or([1.0; 3]);
        sum.iter_mut().zip(color).for_each(|(sum, c)| *sum += c);
    }
    let [r, g, b] = sum.map(|c| srgb(c / (SAMPLES * SAMPLES) as f64));
    [r, g, b, 255]
}
