//! Colour images compressed by compressed_image_transport: JPEG.

use std::panic::{AssertUnwindSafe, catch_unwind};

use lattice_msgs::sensor_msgs::{CompressedImage, Image};
use thiserror::Error;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Reason for rejecting a JPEG image.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(super) enum JpegError {
    /// Unsupported format.
    #[error("format '{0}', expected jpeg")]
    Format(String),
    /// Pixel count above the limit.
    #[error("{width} x {height} pixels, more than `max_image_pixels` {max}")]
    TooLarge {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// The limit.
        max: usize,
    },
    /// Damaged file.
    #[error("its JPEG file: {0}")]
    File(String),
}

impl JpegError {
    /// Counter name.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Format(_) => "encoding",
            Self::TooLarge { .. } => "too_large",
            Self::File(_) => "malformed",
        }
    }
}

/// Decoded image as rgb8, with the header of the message.
pub(super) fn image(message: &CompressedImage, max: usize) -> Result<Image, JpegError> {
    if !message.data.starts_with(&[0xff, 0xd8]) {
        let format = message.format.chars().take(32).collect();
        return Err(JpegError::Format(format));
    }
    // The decoder may panic on damaged files.
    let read = catch_unwind(AssertUnwindSafe(|| pixels(&message.data, max)));
    let read = read.unwrap_or_else(|_| Err(JpegError::File("it cannot be decoded".to_owned())));
    let (width, height, data) = read?;
    Ok(Image {
        header: message.header.clone(),
        height: height as u32,
        width: width as u32,
        encoding: "rgb8".to_owned(),
        is_bigendian: 0,
        step: (3 * width) as u32,
        data: data.into(),
    })
}

fn pixels(bytes: &[u8], max: usize) -> Result<(usize, usize, Vec<u8>), JpegError> {
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::RGB)
        .set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let in_words = |error: zune_jpeg::errors::DecodeErrors| {
        let text = format!("{error:?}");
        JpegError::File(text.chars().filter(|c| !c.is_control()).take(120).collect())
    };
    decoder.decode_headers().map_err(in_words)?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    if width.saturating_mul(height) > max {
        return Err(JpegError::TooLarge { width, height, max });
    }
    Ok((width, height, decoder.decode().map_err(in_words)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 16 x 8 pixels: the left half red, the right half blue, by Pillow 13 with quality 95.
    const RED_BLUE: &[u8] = include_bytes!("red_blue.jpg");

    fn message(data: &[u8]) -> CompressedImage {
        CompressedImage {
            format: "rgb8; jpeg compressed bgr8".to_owned(),
            data: data.to_vec().into(),
            ..CompressedImage::default()
        }
    }

    #[test]
    fn colors_come_out_as_they_went_in() {
        let image = image(&message(RED_BLUE), 128).unwrap();
        assert_eq!((image.width, image.height, image.step), (16, 8, 48));
        let (left, right) = (&image.data[3..6], &image.data[42..45]);
        assert!(left[0] > 240 && left[2] < 20, "{left:?}");
        assert!(right[2] > 240 && right[0] < 20, "{right:?}");
    }

    #[test]
    fn what_is_no_jpeg_is_refused() {
        let name = |data: &[u8], max: usize| image(&message(data), max).unwrap_err().name();
        assert_eq!(name(b"\x89PNG", 128), "encoding");
        assert_eq!(name(&[], 128), "encoding");
        assert_eq!(name(RED_BLUE, 127), "too_large");
        assert_eq!(name(&RED_BLUE[..RED_BLUE.len() / 3], 128), "malformed");
        // Whatever single bytes become, nothing panics.
        for place in 2..RED_BLUE.len() {
            let mut data = RED_BLUE.to_vec();
            data[place] ^= 0xff;
            let _ = image(&message(&data), 1 << 20);
        }
    }
}
