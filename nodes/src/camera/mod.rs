//! Cameras and images as messages: pixel rays, validated images, labels.

mod camera_error;
mod distortion;
mod image;
mod labels;
mod palette;
mod pinhole;
mod pixels;
mod point_layout;
mod points;
mod soft;

pub use camera_error::CameraError;
pub use image::{Content, ImageError, ImageView};
pub use labels::{ClassRules, Classes};
pub use pinhole::Camera;
pub use pixels::{LabelSet, Pixel, PixelReader};
pub use point_layout::PointLayout;
pub use points::LabelledPoints;
pub use soft::{SHARES, Share, SoftLabels};
