//! Compressed images.

use lattice_msgs::sensor_msgs::{CompressedImage, Image};

#[cfg(feature = "onnx")]
use super::jpeg;
#[cfg(not(feature = "onnx"))]
use super::network::ModelError;

/// Decodes a JPEG image to rgb8, or returns reason and text of its rejection. Its size is checked before allocation.
#[cfg_attr(
    not(feature = "onnx"),
    expect(unused_variables, reason = "there is no decoder")
)]
pub(crate) fn unpacked(
    message: &CompressedImage,
    max_pixels: usize,
) -> Result<Image, (&'static str, String)> {
    #[cfg(feature = "onnx")]
    return jpeg::image(message, max_pixels).map_err(|error| (error.name(), error.to_string()));
    #[cfg(not(feature = "onnx"))]
    Err(("encoding", ModelError::NotBuilt("onnx").to_string()))
}
