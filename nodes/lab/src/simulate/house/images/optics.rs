//! Cameras of images, and their messages.

use lattice_core::pose::Axes;
use lattice_msgs::sensor_msgs::CameraInfo;
use lattice_nodes::convert::geometry::header;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

use crate::simulate::house::camera::Camera;
use crate::simulate::house::headset::{HFOV_DEG as HEADSET_HFOV_DEG, PIXELS as HEADSET_PIXELS};
use crate::simulate::house::robot::HFOV_DEG as ROBOT_HFOV_DEG;

/// A pinhole camera with square pixels and its axis in the middle of the image, and how it makes colours of
/// light.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RoomCamera {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Horizontal field of view, degrees.
    pub hfov_deg: f64,
    /// Mean of an image that the exposure aims at, of 0 to 1, linear.
    pub exposure: f32,
    /// Standard deviation of the logarithm by which it misses.
    pub exposure_spread: f32,
    /// Noise of black, and of light: standard deviations at 0 and its growth to that of full light, linear.
    pub noise: [f32; 2],
    /// Share of light that is lost in the corners.
    pub vignetting: f32,
    /// Largest gain of red against blue, and of blue against red, by white balance.
    pub balance: f32,
}

impl RoomCamera {
    /// The depth camera of the robot.
    pub const ROBOT: RoomCamera = RoomCamera {
        width: 256,
        height: 192,
        hfov_deg: ROBOT_HFOV_DEG,
        exposure: 0.22,
        exposure_spread: 0.2,
        noise: [0.004, 0.025],
        vignetting: 0.2,
        balance: 0.08,
    };

    /// The front camera of the headset: narrower, darker, noisier.
    pub const HEADSET: RoomCamera = RoomCamera {
        width: 256,
        height: 256 * HEADSET_PIXELS[1] / HEADSET_PIXELS[0],
        hfov_deg: HEADSET_HFOV_DEG,
        exposure: 0.15,
        exposure_spread: 0.3,
        noise: [0.01, 0.05],
        vignetting: 0.4,
        balance: 0.15,
    };

    /// The same camera with so many pixels over the same width of view.
    pub fn sized(self, width: usize, height: usize) -> RoomCamera {
        RoomCamera {
            width,
            height,
            ..self
        }
    }

    /// Focal length, pixels.
    pub fn focal_px(&self) -> f64 {
        self.width as f64 / 2.0 / (self.hfov_deg.to_radians() / 2.0).tan()
    }

    /// The ray of a pixel's centre: x forward (1), y left, z up.
    pub fn ray(&self, column: usize, row: usize) -> Vector3<f64> {
        let camera = Camera::new(self.width, self.height, self.hfov_deg);
        camera.direction(row * self.width + column)
    }

    /// The calibration as nodes take it: no distortion.
    pub fn camera_info(&self, frame_id: &str, stamp_ns: i64) -> CameraInfo {
        let focal_px = self.focal_px();
        let [cx, cy] = [self.width, self.height].map(|side| side as f64 / 2.0 - 0.5);
        CameraInfo {
            header: header(frame_id, stamp_ns),
            width: self.width as u32,
            height: self.height as u32,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.0; 5],
            k: [focal_px, 0.0, cx, 0.0, focal_px, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [
                focal_px, 0.0, cx, 0.0, 0.0, focal_px, cy, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            ..CameraInfo::default()
        }
    }

    /// Rotation of the optical frame (z forward, x right, y down) in that of the camera.
    pub fn camera_from_optical() -> UnitQuaternion<f64> {
        let rotation = Rotation3::from_matrix_unchecked(Axes::Optical.matrix());
        UnitQuaternion::from_rotation_matrix(&rotation)
    }
}
