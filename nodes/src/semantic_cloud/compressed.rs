//! Depth images compressed by compressed_depth_image_transport.

use lattice_msgs::sensor_msgs::{CompressedImage, Image};
use serde_bytes::ByteBuf;
use thiserror::Error;

/// Header before the PNG data: quantization type and its two parameters.
const HEADER_BYTES: usize = 12;

/// Reason for rejecting a compressed depth image.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CompressedError {
    /// Unsupported format.
    #[error(
        "format '{0}', expected 16UC1 or 32FC1 as compressedDepth png (the transport's parameter \
         `format`; rvl is not supported)"
    )]
    Format(String),
    /// Missing header.
    #[error("{0} bytes, but 12 and a PNG file are needed")]
    Short(usize),
    /// Invalid parameters.
    #[error("the parameters of its quantization are not finite, or the first is not positive")]
    Quantization,
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
    /// Damaged PNG data.
    #[error("its PNG file: {0}")]
    Png(String),
}

impl CompressedError {
    /// Counter name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Format(_) => "encoding",
            Self::TooLarge { .. } => "too_large",
            Self::Short(_) | Self::Quantization | Self::Png(_) => "malformed",
        }
    }
}

/// Decoded image: 16UC1 unchanged, 32FC1 from quantized inverse depths.
pub fn depth_image(message: &CompressedImage, max: usize) -> Result<Image, CompressedError> {
    let (encoding, kind) = message.format.split_once(';').unwrap_or_default();
    let encoding = encoding.trim();
    let is_known = ["16UC1", "32FC1"].contains(&encoding)
        && ["compressedDepth", "compressedDepth png"].contains(&kind.trim());
    if !is_known {
        let format = message.format.chars().take(32).collect();
        return Err(CompressedError::Format(format));
    }
    let short = || CompressedError::Short(message.data.len());
    let (header, file) = message
        .data
        .split_at_checked(HEADER_BYTES)
        .ok_or_else(short)?;
    let number = |at: usize| {
        let bytes = header.get(at..).and_then(<[u8]>::first_chunk);
        bytes.copied().map_or(f32::NAN, f32::from_le_bytes)
    };
    let (a, b) = (number(4), number(8));
    let is_inverse = encoding == "32FC1";
    if is_inverse && !(a.is_finite() && a > 0.0 && b.is_finite()) {
        return Err(CompressedError::Quantization);
    }
    let (width, height, mut data) = gray(file, max)?;
    if is_inverse {
        let (numbers, _) = data.as_chunks::<2>();
        let depth = |bytes: &[u8; 2]| match u16::from_be_bytes(*bytes) {
            0 => f32::NAN,
            number => a / (f32::from(number) - b),
        };
        data = numbers
            .iter()
            .map(depth)
            .flat_map(f32::to_le_bytes)
            .collect();
    }
    Ok(Image {
        header: message.header.clone(),
        height,
        width,
        encoding: encoding.to_owned(),
        is_bigendian: (!is_inverse).into(),
        step: width.saturating_mul(if is_inverse { 4 } else { 2 }),
        data: ByteBuf::from(data),
    })
}

/// Size and 16-bit big-endian values of a grey PNG file.
#[cfg(feature = "compressed_depth")]
fn gray(file: &[u8], max: usize) -> Result<(u32, u32, Vec<u8>), CompressedError> {
    let bad = |error: png::DecodingError| CompressedError::Png(error.to_string());
    // Two bytes a pixel, plus the decoder's own buffers.
    let bytes = max.saturating_mul(2).saturating_add(1 << 20);
    let limits = png::Limits { bytes };
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(file), limits);
    let info = decoder.read_header_info().map_err(bad)?;
    let (width, height) = info.size();
    if u64::from(width) * u64::from(height) > max as u64 {
        return Err(CompressedError::TooLarge { width, height, max });
    }
    if (info.color_type, info.bit_depth) != (png::ColorType::Grayscale, png::BitDepth::Sixteen) {
        let problem = "it is not grey with 16 bits a pixel";
        return Err(CompressedError::Png(problem.to_owned()));
    }
    let mut reader = decoder.read_info().map_err(bad)?;
    let mut data = vec![0; width as usize * height as usize * 2];
    reader.next_frame(&mut data).map_err(bad)?;
    Ok((width, height, data))
}

#[cfg(not(feature = "compressed_depth"))]
fn gray(_file: &[u8], _max: usize) -> Result<(u32, u32, Vec<u8>), CompressedError> {
    let problem = "this program was built without the feature `compressed_depth`";
    Err(CompressedError::Png(problem.to_owned()))
}
