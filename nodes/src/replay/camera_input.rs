//! Inputs of a depth camera.

/// Input of a depth camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraInput {
    /// Depth images.
    Depth,
    /// Depth images of compressed_depth_image_transport.
    CompressedDepth,
    /// Calibration of the depth images.
    Info,
    /// Label images.
    Labels,
    /// Class names.
    LabelInfo,
    /// Confidences of the labels.
    Confidence,
    /// Colour images.
    Color,
    /// Colour images as JPEG.
    CompressedColor,
}

impl CameraInput {
    /// True for images that depth images are matched with.
    pub fn is_companion(self) -> bool {
        matches!(
            self,
            Self::Labels | Self::Confidence | Self::Color | Self::CompressedColor
        )
    }
}
