//! Conversion of colour images to tensors: resized, normalised, planar.

use super::network::Size;
use crate::camera::ImageView;

/// Normalisation of colours from 0 to 1: (colour - mean) / deviation, red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalisation {
    /// Means.
    pub mean: [f32; 3],
    /// Deviations.
    pub deviation: [f32; 3],
}

/// Two adjacent pixels on an axis and the weight of the second.
#[derive(Clone, Copy)]
struct Between {
    first: usize,
    second: usize,
    weight: f32,
}

/// Positions of the centres of `to` pixels among the centres of `from` pixels; ends are clamped.
fn between(from: usize, to: usize) -> Vec<Between> {
    let last = from.saturating_sub(1);
    let scale = from as f32 / to.max(1) as f32;
    let place = |at: usize| {
        let at = ((at as f32 + 0.5) * scale - 0.5).clamp(0.0, last as f32);
        let first = (at as usize).min(last);
        Between {
            first,
            second: (first + 1).min(last),
            weight: at - first as f32,
        }
    };
    (0..to).map(place).collect()
}

/// Image rows, converted to 0 to 1.
struct Rows<'a> {
    view: ImageView<'a>,
    columns: Vec<Between>,
    bytes: Vec<[u8; 3]>,
    /// The last two rows, sampled at the network's columns, with their indices.
    kept: [(Option<usize>, Vec<[f32; 3]>); 2],
}

fn mixed(a: [f32; 3], b: [f32; 3], weight: f32) -> [f32; 3] {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * weight)
}

impl Rows<'_> {
    /// Converts a row into slot 0 or 1; rows are requested in ascending order.
    fn keep(&mut self, place: usize, row: usize) {
        if place == 0 && self.kept[1].0 == Some(row) {
            self.kept.swap(0, 1);
        }
        if self.kept[place].0 == Some(row) {
            return;
        }
        self.bytes.clear();
        self.view.colors(row, &mut self.bytes);
        let color = |at: usize| {
            let bytes = self.bytes.get(at).copied().unwrap_or_default();
            bytes.map(|v| f32::from(v) / 255.0)
        };
        let columns = self.columns.iter();
        let kept = columns.map(|b| mixed(color(b.first), color(b.second), b.weight));
        self.kept[place] = (Some(row), kept.collect());
    }
}

/// Tensor of an image, resized bilinearly: red, green and blue planes.
pub fn planes(view: ImageView<'_>, size: Size, normalisation: &Normalisation) -> Vec<f32> {
    let rows = between(view.height, size.height);
    let mut read = Rows {
        columns: between(view.width, size.width),
        view,
        bytes: Vec::new(),
        kept: Default::default(),
    };
    let mut planes = vec![0.0; 3 * size.pixels()];
    let (red, rest) = planes.split_at_mut(size.pixels());
    let (green, blue) = rest.split_at_mut(size.pixels());
    let out = red.iter_mut().zip(green).zip(blue);
    let mut out = out.map(|((r, g), b)| [r, g, b]);
    let Normalisation { mean, deviation } = normalisation;
    for between in rows {
        read.keep(0, between.first);
        read.keep(1, between.second);
        let [(_, first), (_, second)] = &read.kept;
        for (a, b) in first.iter().zip(second) {
            let color = mixed(*a, *b, between.weight);
            for (channel, out) in out.next().into_iter().flatten().enumerate() {
                *out = (color[channel] - mean[channel]) / deviation[channel];
            }
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Content;
    use lattice_msgs::sensor_msgs::Image;

    const PLAIN: Normalisation = Normalisation {
        mean: [0.0; 3],
        deviation: [1.0; 3],
    };

    fn planes_of(image: &Image, width: usize, height: usize) -> Vec<f32> {
        let view = ImageView::new(image, Content::Colors, 100).unwrap();
        planes(view, Size { width, height }, &PLAIN)
    }

    fn image(encoding: &str, step: u32, data: &[u8]) -> Image {
        Image {
            height: 2,
            width: 2,
            encoding: encoding.to_owned(),
            step,
            data: data.to_vec().into(),
            ..Image::default()
        }
    }

    #[test]
    fn planes_are_red_green_and_blue_in_every_encoding() {
        let rgb = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [51, 102, 153]];
        let expected = [1.0, 0.0, 0.0, 0.2, 0.0, 1.0, 0.0, 0.4, 0.0, 0.0, 1.0, 0.6];
        let reversed = rgb.map(|[r, g, b]| [b, g, r]);
        let with_alpha = |pixels: [[u8; 3]; 4]| pixels.map(|[a, b, c]| [a, b, c, 7]);
        for (encoding, step, data) in [
            ("rgb8", 6, rgb.concat()),
            ("bgr8", 6, reversed.concat()),
            ("rgba8", 8, with_alpha(rgb).concat()),
            ("bgra8", 8, with_alpha(reversed).concat()),
        ] {
            assert_eq!(planes_of(&image(encoding, step, &data), 2, 2), expected);
        }
        let grey = image("mono8", 2, &[0, 51, 102, 255]);
        assert_eq!(planes_of(&grey, 2, 2), [0.0, 0.2, 0.4, 1.0].repeat(3));
    }

    #[test]
    fn sizes_differ_by_the_places_of_centres() {
        let grey = image("mono8", 2, &[0, 100, 50, 150]);
        let to = |width, height| -> Vec<f32> {
            let planes = planes_of(&grey, width, height);
            let first = planes[..width * height].iter();
            first.map(|v| (v * 255.0 * 10.0).round() / 10.0).collect()
        };
        assert_eq!(to(1, 1), [75.0]);
        assert_eq!(to(4, 1), [25.0, 50.0, 100.0, 125.0]);
        let four = to(4, 4);
        assert_eq!(four[..4], [0.0, 25.0, 75.0, 100.0]);
        assert_eq!(four[4..8], [12.5, 37.5, 87.5, 112.5]);
        assert_eq!(four[12..], [50.0, 75.0, 125.0, 150.0]);
    }
}
