//! Labels of one view with their companion images, sampled at the pixels of another image of the view.

use std::sync::Arc;

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::Image;

use super::image::{Content, ImageView};
use super::labels::{Classes, Sampled, nearest};
use super::point_layout::PointLayout;
use super::soft::{SHARES, Share, SoftLabels};

/// Labels of one stamp with their companion images; each of any size.
#[derive(Clone, Debug)]
pub struct LabelSet {
    /// Class numbers.
    pub labels: Arc<Image>,
    /// Confidences of the classes.
    pub confidence: Option<Arc<Image>>,
    /// Colours.
    pub colors: Option<Arc<Image>>,
    /// Probabilities of the best classes.
    pub soft: Option<Arc<SoftLabels>>,
}

impl LabelSet {
    /// Labels alone.
    pub fn new(labels: Arc<Image>) -> Self {
        Self {
            labels,
            confidence: None,
            colors: None,
            soft: None,
        }
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        let images = [
            Some(&self.labels),
            self.confidence.as_ref(),
            self.colors.as_ref(),
        ];
        let images = images.into_iter().flatten();
        let images: usize = images.map(|i| size_of::<Image>() + i.data.len()).sum();
        images + self.soft.as_ref().map_or(0, |soft| soft.bytes())
    }

    /// Sampler at the pixels of an image of `width` columns; `None` if an image is invalid.
    pub fn reader(&self, width: usize, max_pixels: usize) -> Option<PixelReader<'_>> {
        let view = |image, content| ImageView::new(image, content, max_pixels).ok();
        let labels = view(&self.labels, Content::Labels)?;
        let confidence = match &self.confidence {
            Some(image) => Some(view(image, Content::Confidence)?),
            None => None,
        };
        let colors = match &self.colors {
            Some(image) => Some(view(image, Content::Colors)?),
            None => None,
        };
        let soft = self.soft.as_deref();
        Some(PixelReader {
            labels: Sampled::new(labels, width, ImageView::classes),
            confidence: confidence.map(|v| Sampled::new(v, width, ImageView::confidences)),
            colors: colors.map(|v| Sampled::new(v, width, ImageView::colors)),
            columns: soft.map_or_else(Vec::new, |soft| {
                let columns = 0..width;
                columns.map(|c| nearest(c, width, soft.width)).collect()
            }),
            soft_row: 0,
            soft,
        })
    }
}

/// Label and colour of a pixel, where given.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Label number.
    pub number: u16,
    /// Confidence of the class, 0 to 1; 1 if not given.
    pub confidence: f32,
    /// Red, green and blue.
    pub color: [u8; 3],
    /// Probabilities of the best classes.
    pub shares: [Share; SHARES],
}

impl Pixel {
    /// Unlabelled pixel.
    pub const NONE: Self = Self {
        number: UNLABELED,
        confidence: 1.0,
        color: [0; 3],
        shares: [Share::NONE; SHARES],
    };

    /// Pixel with a certain class.
    pub fn certain(number: u16) -> Self {
        Self {
            number,
            ..Self::NONE
        }
    }
}

/// Samplers of all images of a [`LabelSet`], row by row.
pub struct PixelReader<'a> {
    labels: Sampled<'a, u16>,
    confidence: Option<Sampled<'a, f32>>,
    colors: Option<Sampled<'a, [u8; 3]>>,
    soft: Option<&'a SoftLabels>,
    columns: Vec<usize>,
    soft_row: usize,
}

impl PixelReader<'_> {
    /// Layout of points with all sampled fields.
    pub fn layout(&self, classes: &Classes) -> PointLayout {
        PointLayout {
            has_color: self.colors.is_some(),
            viewpoint_m: None,
            classes: self.soft.map_or(0, |soft| soft.elements(classes)),
        }
    }

    /// Selects the row for a row of the other image of `height` rows.
    pub fn seek(&mut self, row: usize, height: usize) {
        self.labels.seek(row, height);
        if let Some(confidence) = &mut self.confidence {
            confidence.seek(row, height);
        }
        if let Some(colors) = &mut self.colors {
            colors.seek(row, height);
        }
        if let Some(soft) = self.soft {
            self.soft_row = nearest(row, height, soft.height);
        }
    }

    /// Pixel at a column of the other image.
    pub fn at(&self, column: usize) -> Pixel {
        let confidence = self.confidence.as_ref();
        let soft = self.soft.zip(self.columns.get(column));
        Pixel {
            number: self.labels.at(column).unwrap_or(UNLABELED),
            confidence: confidence.map_or(1.0, |c| c.at(column).unwrap_or(0.0)),
            color: self
                .colors
                .as_ref()
                .and_then(|c| c.at(column))
                .unwrap_or_default(),
            shares: soft.map_or([Share::NONE; SHARES], |(soft, column)| {
                soft.at(*column, self.soft_row)
            }),
        }
    }
}
