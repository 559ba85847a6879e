//! Cameras and images as messages: pixel rays, validated images, labels.

mod distortion;
mod image;
mod labels;
mod palette;
mod pinhole;
mod pixels;
mod points;
mod soft;

pub use image::{Content, ImageError, ImageView};
pub use labels::{ClassRules, Classes};
pub use pinhole::{Camera, CameraError};
pub use pixels::{LabelSet, Pixel, PixelReader};
pub use points::{LabelledPoints, PointLayout};
pub use soft::{SHARES, Share, SoftLabels};
