//! Elevation maps as GeoTIFF.

use std::io::{Seek, Write};

use lattice_core::navigation::Elevation;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::ColorType;
use tiff::tags::{PhotometricInterpretation, SampleFormat, Tag};

use super::error::ExportError;

/// Layers of [`Elevation::layers`].
const LAYERS: usize = 5;

/// GDAL's tag for the names of bands.
const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// Keys of GeoTIFF 1.1: a model of the user's own (32767) with a citation, and pixels that are areas.
const GEO_KEYS: [u16; 16] = [
    1,
    1,
    1,
    3, // Version of the directory, revision of the keys, number of keys.
    1024,
    0,
    1,
    32767, //
    1025,
    0,
    1,
    1, //
    1026,
    34737,
    CITATION.len() as u16,
    0, //
];

/// Citation of the model.
const CITATION: &str = "map frame, metres|";

/// Pixel with a number of single precision for each layer.
struct Pixel;

impl ColorType for Pixel {
    type Inner = f32;
    const TIFF_VALUE: PhotometricInterpretation = PhotometricInterpretation::BlackIsZero;
    const BITS_PER_SAMPLE: &'static [u16] = &[32; LAYERS];
    const SAMPLE_FORMAT: &'static [SampleFormat] = &[SampleFormat::IEEEFP; LAYERS];

    fn horizontal_predict(row: &[f32], result: &mut Vec<f32>) {
        // The encoder refuses a predictor for such numbers.
        result.extend_from_slice(row);
    }
}

/// Writes the layers as bands with their names; NaN is unknown, and the first row is that of the greatest y.
pub fn write_elevation_tiff(
    elevation: &Elevation,
    out: &mut (impl Write + Seek),
) -> Result<(), ExportError> {
    let (width, resolution_m) = (elevation.width, elevation.resolution_m);
    let layers = elevation.layers();
    let mut samples = Vec::with_capacity(LAYERS * elevation.elevation_m.len());
    for row in (0..elevation.height).rev() {
        for i in row * width..(row + 1) * width {
            let value = |layer: &[f32]| layer.get(i).copied().unwrap_or(f32::NAN);
            samples.extend(layers.map(|(_, layer)| value(layer)));
        }
    }
    let name = |band: usize, name: &str| {
        format!("<Item name=\"DESCRIPTION\" sample=\"{band}\" role=\"description\">{name}</Item>")
    };
    let names = layers.iter().enumerate();
    let names: String = names.map(|(band, (text, _))| name(band, text)).collect();
    let edge_m = |corner: i32, cells: usize| (f64::from(corner) + cells as f64) * resolution_m;
    let (left_m, top_m) = (
        edge_m(elevation.corner[0], 0),
        edge_m(elevation.corner[1], elevation.height),
    );

    let mut encoder = TiffEncoder::new(out)?;
    let mut image = encoder.new_image::<Pixel>(width as u32, elevation.height as u32)?;
    let tags = image.encoder();
    // Bands after the first one are data of no stated kind.
    tags.write_tag(Tag::ExtraSamples, &[0_u16; LAYERS - 1][..])?;
    tags.write_tag(
        Tag::ModelPixelScaleTag,
        &[resolution_m, resolution_m, 0.0][..],
    )?;
    tags.write_tag(
        Tag::ModelTiepointTag,
        &[0.0, 0.0, 0.0, left_m, top_m, 0.0][..],
    )?;
    tags.write_tag(Tag::GeoKeyDirectoryTag, &GEO_KEYS[..])?;
    tags.write_tag(Tag::GeoAsciiParamsTag, CITATION)?;
    tags.write_tag(
        GDAL_METADATA,
        &*format!("<GDALMetadata>{names}</GDALMetadata>"),
    )?;
    tags.write_tag(Tag::GdalNodata, "nan")?;
    image.write_data(&samples)?;
    Ok(())
}
