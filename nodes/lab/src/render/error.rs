//! Error of a picture.

use std::io;

use thiserror::Error;

/// Error of a picture of a map.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The system could not write.
    #[error("writing failed: {0}")]
    Io(#[from] io::Error),
    /// The picture cannot have this size.
    #[error(
        "a picture of {width} x {height} pixels: each side must be 1 to {max_side}, and their \
         product at most {max_pixels}"
    )]
    PictureSize {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Longest side, pixels.
        max_side: u32,
        /// Largest product of the sides.
        max_pixels: u64,
    },
    /// The camera cannot stand like this.
    #[error(
        "a camera at azimuth {azimuth_deg} and elevation {elevation_deg} degrees with zoom {zoom}: the \
         azimuth must be finite, the elevation -90 to 90, the zoom 0.01 to 1000"
    )]
    Camera {
        /// Degrees.
        azimuth_deg: f64,
        /// Degrees.
        elevation_deg: f64,
        /// 1 for the whole map.
        zoom: f64,
    },
    /// There is no such place.
    #[error(
        "a picture {width_m} m wide around {center_m:?}: both must be finite, the width 0.001 to 1e7"
    )]
    Focus {
        /// In the middle, metres.
        center_m: [f64; 3],
        /// Metres.
        width_m: f64,
    },
    /// The PNG encoder failed.
    #[error("writing the PNG failed: {0}")]
    Png(#[from] png::EncodingError),
}
