//! Image pixels, after validation of the header against the data length.

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::Image;
use thiserror::Error;

/// Reason for rejecting an image.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ImageError {
    /// Unsupported encoding.
    #[error("encoding '{found}', expected {expected}")]
    Encoding {
        /// Encoding, shortened.
        found: String,
        /// Supported encodings.
        expected: &'static str,
    },
    /// Pixel count above the limit.
    #[error("{width} x {height} pixels, more than `max_image_pixels` {max}")]
    TooLarge {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// The limit.
        max: usize,
    },
    /// Empty image.
    #[error("{width} x {height} pixels: it is empty")]
    Empty {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Row step shorter than a row.
    #[error("step {step}, but a row of {width} pixels has {row} bytes")]
    Step {
        /// Row step as stated, bytes.
        step: u32,
        /// Pixels in a row.
        width: u32,
        /// Bytes of a row.
        row: u64,
    },
    /// Data shorter than stated.
    #[error("{found} bytes, but {height} rows with step {step} need {needed}")]
    Truncated {
        /// Length of the data, bytes.
        found: usize,
        /// Rows.
        height: u32,
        /// Bytes from row to row.
        step: u32,
        /// Required length, bytes.
        needed: u64,
    },
}

impl ImageError {
    /// Counter name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Encoding { .. } => "encoding",
            Self::TooLarge { .. } => "too_large",
            Self::Empty { .. } | Self::Step { .. } | Self::Truncated { .. } => "malformed",
        }
    }
}

/// Pixel data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pixel {
    /// mono8, 8UC1.
    U8,
    /// mono16, 16UC1.
    U16,
    /// 32SC1.
    I32,
    /// 32FC1.
    F32,
    /// rgb8, rgba8 with 4 bytes.
    Rgb(u8),
    /// bgr8, 8UC3, bgra8 with 4 bytes.
    Bgr(u8),
}

impl Pixel {
    fn of(encoding: &str) -> Option<Self> {
        match encoding {
            "mono8" | "8UC1" => Some(Self::U8),
            "mono16" | "16UC1" => Some(Self::U16),
            "32SC1" => Some(Self::I32),
            "32FC1" => Some(Self::F32),
            "rgb8" => Some(Self::Rgb(3)),
            "rgba8" => Some(Self::Rgb(4)),
            "bgr8" | "8UC3" => Some(Self::Bgr(3)),
            "bgra8" | "8UC4" => Some(Self::Bgr(4)),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::I32 | Self::F32 => 4,
            Self::Rgb(bytes) | Self::Bgr(bytes) => usize::from(bytes),
        }
    }
}

/// True for colour encodings.
pub(super) fn is_colored(encoding: &str) -> bool {
    matches!(Pixel::of(encoding), Some(Pixel::Rgb(_) | Pixel::Bgr(_)))
}

/// Meaning of the pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Distances along the optical axis: 16UC1 in mm, 32FC1 in m.
    Depth,
    /// Class numbers: mono8, 8UC1, mono16, 16UC1, 32SC1.
    Labels,
    /// Confidences: 0 to 1 in 32FC1, 0 to the largest number in mono8, 8UC1, mono16, 16UC1.
    Confidence,
    /// Colours: rgb8, bgr8, rgba8, bgra8, 8UC3, 8UC4, or grey: mono8, 8UC1.
    Colors,
}

impl Content {
    fn encodings(self) -> (&'static [Pixel], &'static str) {
        match self {
            Self::Depth => (&[Pixel::U16, Pixel::F32], "16UC1 or 32FC1"),
            Self::Labels => (
                &[Pixel::U8, Pixel::U16, Pixel::I32],
                "mono8, 8UC1, mono16, 16UC1 or 32SC1 (colours need `palette_rgb_class`)",
            ),
            Self::Confidence => (
                &[Pixel::F32, Pixel::U8, Pixel::U16],
                "32FC1, mono8, 8UC1, mono16 or 16UC1",
            ),
            Self::Colors => (
                &[
                    Pixel::Rgb(3),
                    Pixel::Bgr(3),
                    Pixel::Rgb(4),
                    Pixel::Bgr(4),
                    Pixel::U8,
                ],
                "rgb8, bgr8, rgba8, bgra8 or mono8",
            ),
        }
    }
}

/// Validated image.
#[derive(Clone, Copy, Debug)]
pub struct ImageView<'a> {
    /// Pixels in a row, at least 1.
    pub width: usize,
    /// Rows, at least 1.
    pub height: usize,
    /// Pixel data type.
    pub pixel: Pixel,
    step: usize,
    is_bigendian: bool,
    data: &'a [u8],
}

impl<'a> ImageView<'a> {
    /// Validates encoding, size, step and length, in this order; allocates nothing for the pixels.
    pub fn new(image: &'a Image, content: Content, max_pixels: usize) -> Result<Self, ImageError> {
        let (pixels, expected) = content.encodings();
        let pixel = Pixel::of(&image.encoding).filter(|pixel| pixels.contains(pixel));
        let pixel = pixel.ok_or_else(|| ImageError::Encoding {
            found: image.encoding.chars().take(32).collect(),
            expected,
        })?;
        let (width, height, step) = (image.width, image.height, image.step);
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { width, height });
        }
        let max = max_pixels;
        if u64::from(width) * u64::from(height) > max as u64 {
            return Err(ImageError::TooLarge { width, height, max });
        }
        let row = u64::from(width) * pixel.bytes() as u64;
        if u64::from(step) < row {
            return Err(ImageError::Step { step, width, row });
        }
        // The last row may have no padding.
        let needed = u64::from(step) * u64::from(height - 1) + row;
        if (image.data.len() as u64) < needed {
            return Err(ImageError::Truncated {
                found: image.data.len(),
                height,
                step,
                needed,
            });
        }
        Ok(Self {
            width: width as usize,
            height: height as usize,
            pixel,
            step: step as usize,
            is_bigendian: image.is_bigendian != 0,
            data: &image.data,
        })
    }

    /// Bytes of a row; empty beyond the last.
    fn row(&self, row: usize) -> &'a [u8] {
        let begin = row.saturating_mul(self.step);
        let end = begin.saturating_add(self.width * self.pixel.bytes());
        self.data.get(begin..end).unwrap_or_default()
    }

    /// Values of a row in order.
    fn numbers<const N: usize, T>(
        &self,
        row: usize,
        from_bytes: fn([u8; N]) -> T,
    ) -> impl Iterator<Item = T> {
        let big = self.is_bigendian;
        let (numbers, _) = self.row(row).as_chunks::<N>();
        numbers.iter().map(move |bytes| {
            let mut bytes = *bytes;
            if big {
                bytes.reverse();
            }
            from_bytes(bytes)
        })
    }

    /// Depths of a row in m; NaN for missing values: 0, negative, infinite.
    pub fn depths_m(&self, row: usize, out: &mut Vec<f32>) {
        let valid = |z_m: f32| {
            if z_m > 0.0 && z_m < f32::INFINITY {
                z_m
            } else {
                f32::NAN
            }
        };
        match self.pixel {
            Pixel::F32 => out.extend(self.numbers(row, f32::from_le_bytes).map(valid)),
            _ => {
                let depths_mm = self.numbers(row, u16::from_le_bytes);
                out.extend(depths_mm.map(|mm| valid((f64::from(mm) * 1e-3) as f32)));
            }
        }
    }

    /// Classes of a row. `UNLABELED`: the largest number of the encoding, or a number outside 0..=65534.
    pub fn classes(&self, row: usize, out: &mut Vec<u16>) {
        match self.pixel {
            Pixel::U8 => out.extend(self.numbers(row, u8::from_le_bytes).map(
                |class| match class {
                    u8::MAX => UNLABELED,
                    class => u16::from(class),
                },
            )),
            Pixel::U16 => out.extend(self.numbers(row, u16::from_le_bytes)),
            _ => {
                let classes = self.numbers(row, i32::from_le_bytes);
                out.extend(classes.map(|class| u16::try_from(class).unwrap_or(UNLABELED)));
            }
        }
    }

    /// Confidences of a row, 0 to 1; 0 for NaN.
    pub fn confidences(&self, row: usize, out: &mut Vec<f32>) {
        match self.pixel {
            Pixel::U8 => out.extend(self.row(row).iter().map(|v| f32::from(*v) / 255.0)),
            Pixel::U16 => {
                let numbers = self.numbers(row, u16::from_le_bytes);
                out.extend(numbers.map(|v| f32::from(v) / 65535.0));
            }
            _ => {
                let numbers = self.numbers(row, f32::from_le_bytes);
                out.extend(numbers.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) }));
            }
        }
    }

    /// Red, green and blue of a row.
    pub fn colors(&self, row: usize, out: &mut Vec<[u8; 3]>) {
        let bytes = self.row(row);
        match self.pixel {
            Pixel::Rgb(4) => out.extend(bytes.as_chunks().0.iter().map(|&[r, g, b, _]| [r, g, b])),
            Pixel::Bgr(4) => out.extend(bytes.as_chunks().0.iter().map(|&[b, g, r, _]| [r, g, b])),
            Pixel::Rgb(_) => out.extend_from_slice(bytes.as_chunks().0),
            Pixel::Bgr(_) => out.extend(bytes.as_chunks().0.iter().map(|&[b, g, r]| [r, g, b])),
            _ => out.extend(bytes.iter().map(|grey| [*grey; 3])),
        }
    }
}
