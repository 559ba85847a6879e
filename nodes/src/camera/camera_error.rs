//! Error of a camera.

use thiserror::Error;

/// Reason for rejecting a camera.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CameraError {
    /// Uncalibrated camera.
    #[error("its matrix {matrix} has no focal lengths: the camera is not calibrated")]
    NotCalibrated {
        /// `k`, or `p` of a rectified image.
        matrix: &'static str,
    },
    /// Unknown distortion model.
    #[error(
        "distortion model '{0}', expected plumb_bob, rational_polynomial or equidistant; \
         `rectified: true` if the images are rectified"
    )]
    Model(String),
    /// Wrong number of distortion parameters.
    #[error("{found} parameters of {model}, expected {expected}")]
    Parameters {
        /// The model.
        model: &'static str,
        /// Number of parameters given.
        found: usize,
        /// Allowed numbers.
        expected: &'static str,
    },
    /// NaN or infinite.
    #[error("its numbers are not all finite")]
    NotFinite,
    /// Binned image or region of interest.
    #[error("its image is binned or cut: send a camera_info of the image as it is")]
    Cut,
}

impl CameraError {
    /// Counter name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::NotCalibrated { .. } => "not_calibrated",
            Self::Model(_) => "distortion_model",
            Self::Parameters { .. } | Self::NotFinite => "malformed",
            Self::Cut => "cut",
        }
    }
}
