//! Cameras and their images as messages: rays of pixels, images whose bytes were checked, labels.

mod distortion;
mod image;
mod labels;
mod palette;
mod pinhole;
mod points;

pub use image::{Content, ImageError, ImageView};
pub use labels::{ClassRules, Classes, Sampled};
pub use pinhole::{Camera, CameraError};
pub use points::LabelledPoints;
