//! Conversion of colour masks to images of class numbers.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::Image;

use super::image::{Content, ImageError, ImageView, is_colored};
use crate::convert::semantic::Color;

/// Label image unchanged, or a colour mask converted to 16UC1: colours outside the palette
/// are unlabelled. Without a palette masks are unchanged.
pub fn numbered(
    image: Arc<Image>,
    palette: &BTreeMap<Color, u16>,
    max_pixels: usize,
) -> Result<Arc<Image>, ImageError> {
    if palette.is_empty() || !is_colored(&image.encoding) {
        return Ok(image);
    }
    let view = ImageView::new(&image, Content::Colors, max_pixels)?;
    let mut data = Vec::with_capacity(2 * view.width * view.height);
    let mut colors = Vec::new();
    // Masks have long runs of one colour.
    let mut last = None;
    for row in 0..view.height {
        colors.clear();
        view.colors(row, &mut colors);
        for color in &colors {
            let class = match last {
                Some((known, class)) if known == *color => class,
                _ => palette.get(color).copied().unwrap_or(UNLABELED),
            };
            last = Some((*color, class));
            data.extend_from_slice(&class.to_le_bytes());
        }
    }
    Ok(Arc::new(Image {
        header: image.header.clone(),
        height: image.height,
        width: image.width,
        encoding: "16UC1".to_owned(),
        is_bigendian: 0,
        step: 2 * image.width,
        data: data.into(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(encoding: &str, step: u32, data: &[u8]) -> Arc<Image> {
        Arc::new(Image {
            height: 2,
            width: 2,
            encoding: encoding.to_owned(),
            step,
            data: data.to_vec().into(),
            ..Image::default()
        })
    }

    #[test]
    fn colours_become_the_classes_of_the_palette() {
        let palette = BTreeMap::from([([9, 0, 1], 3), ([0, 0, 0], 260)]);
        // Rows have two bytes more than their pixels.
        let bgr = [1, 0, 9, 1, 0, 9, 7, 7, 0, 0, 0, 9, 0, 1, 7, 7];
        let found = numbered(mask("bgr8", 8, &bgr), &palette, 4).unwrap();
        assert_eq!((found.encoding.as_str(), found.step), ("16UC1", 4));
        assert_eq!(found.data.to_vec(), [3, 0, 3, 0, 4, 1, 255, 255]);
        let error = numbered(mask("bgr8", 8, &bgr), &palette, 3).unwrap_err();
        assert_eq!(error.name(), "too_large");
        let error = numbered(mask("bgr8", 8, &bgr[..9]), &palette, 4).unwrap_err();
        assert_eq!(error.name(), "malformed");
    }

    #[test]
    fn numbers_stay_as_they_are_and_masks_without_a_palette() {
        let palette = BTreeMap::from([([9, 0, 1], 3)]);
        let grey = mask("mono8", 2, &[1, 2, 3, 4]);
        assert_eq!(numbered(Arc::clone(&grey), &palette, 4).unwrap(), grey);
        let colored = mask("rgb8", 6, &[0; 12]);
        let found = numbered(Arc::clone(&colored), &BTreeMap::new(), 4).unwrap();
        assert_eq!(found, colored);
    }
}
