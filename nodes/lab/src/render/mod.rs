//! Pictures of maps: a small software renderer.
//!
//! Cells are drawn in parallel projection, where all faces of one direction have one shape on the
//! screen and one brightness. Sunlight casts shadows, and skylight is dimmed in narrow places.

mod light;
mod picture_options;
mod raster;
mod shade;
mod view;

use crate::AnyError;
use lattice_core::voxels::VoxelList;
use nalgebra::Vector3;
pub use picture_options::{Focus, LabelColors, RenderOptions};
use raster::{Paint, Scene};
use shade::SAMPLES;
use std::io::Write;
use view::View;

/// Longest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;
/// Most pixels of a picture.
const MAX_PIXELS: u64 = 1 << 24;

/// Draws the exposed faces of a map as a PNG picture, coloured by height.
///
/// Memory: some 40 bytes a pixel and 16 a face.
pub fn render_png(
    list: &VoxelList,
    options: &RenderOptions,
    writer: impl Write,
) -> Result<(), AnyError> {
    render(list, &Paint::Height, options, writer)
}

/// The same, coloured by the most counted label of each cell; grey where it has none or none of these.
pub fn render_labels_png(
    list: &VoxelList,
    colors: &LabelColors,
    options: &RenderOptions,
    writer: impl Write,
) -> Result<(), AnyError> {
    render(list, &Paint::Label(colors), options, writer)
}

fn render(
    list: &VoxelList,
    paint: &Paint,
    options: &RenderOptions,
    writer: impl Write,
) -> Result<(), AnyError> {
    check(options)?;
    let scene = Scene::new(list, paint);
    let size = [options.width, options.height].map(|side| side as usize * SAMPLES);
    let view = View::new(options.azimuth_deg, options.elevation_deg, size);
    let view = match options.focus {
        Some(focus) => {
            let center_m = Vector3::from(focus.center_m) - list.datum_m();
            view.at(&center_m, focus.width_m)
        }
        None => view.fit(scene.centers(), scene.radius_m),
    };
    let pixels = shade::picture(&scene, &view, options);

    let mut encoder = png::Encoder::new(writer, options.width, options.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(())
}

fn check(options: &RenderOptions) -> Result<(), AnyError> {
    let RenderOptions {
        width,
        height,
        azimuth_deg,
        elevation_deg,
        ..
    } = *options;
    let sides = 1..=MAX_SIDE;
    let pixels = u64::from(width) * u64::from(height);
    if !sides.contains(&width) || !sides.contains(&height) || pixels > MAX_PIXELS {
        return Err(format!(
            "a picture of {width} x {height} pixels: each side must be 1 to {MAX_SIDE}, and their product at \
             most {MAX_PIXELS}"
        )
        .into());
    }
    let elevated = (-90.0..=90.0).contains(&elevation_deg);
    if !azimuth_deg.is_finite() || !elevated {
        return Err(format!(
            "a camera at azimuth {azimuth_deg} and elevation {elevation_deg} degrees: the azimuth must be finite, \
             the elevation -90 to 90"
        )
        .into());
    }
    if let Some(Focus { center_m, width_m }) = options.focus
        && !(center_m.iter().all(|c| c.is_finite()) && (1e-3..=1e7).contains(&width_m))
    {
        return Err(format!(
            "a picture {width_m} m wide around {center_m:?}: both must be finite, the width 0.001 to 1e7"
        )
        .into());
    }
    Ok(())
}

#[cfg(test)]
mod tests;
