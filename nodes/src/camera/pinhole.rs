//! Pixel rays of a calibrated camera.

use lattice_msgs::sensor_msgs::CameraInfo;

use super::camera_error::CameraError;
use super::distortion::Distortion;

/// A pinhole camera with distortion.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    focal: [f64; 2],
    center: [f64; 2],
    distortion: Distortion,
}

impl Camera {
    /// Camera from its message: `p` for rectified images, else `k` and `d`.
    pub fn new(info: &CameraInfo, rectified: bool) -> Result<Self, CameraError> {
        let roi = &info.roi;
        let part = (roi.width, roi.height);
        let is_whole = (roi.x_offset, roi.y_offset) == (0, 0)
            && (part == (0, 0) || part == (info.width, info.height));
        if !is_whole || info.binning_x > 1 || info.binning_y > 1 {
            return Err(CameraError::Cut);
        }
        let (matrix, numbers) = match rectified {
            true => ("p", [info.p[0], info.p[5], info.p[2], info.p[6]]),
            false => ("k", [info.k[0], info.k[4], info.k[2], info.k[5]]),
        };
        let mut all = numbers.iter().chain(info.d.iter().take(64));
        if !all.all(|v| v.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let [fx, fy, cx, cy] = numbers;
        if fx <= 0.0 || fy <= 0.0 {
            return Err(CameraError::NotCalibrated { matrix });
        }
        let distortion = match rectified {
            true => Distortion::None,
            false => Distortion::new(&info.distortion_model, &info.d)?,
        };
        Ok(Self {
            width: info.width,
            height: info.height,
            focal: [fx, fy],
            center: [cx, cy],
            distortion,
        })
    }

    /// True with lens distortion.
    pub fn is_distorted(&self) -> bool {
        self.distortion != Distortion::None
    }

    /// Pixel of a point in the optical frame; integer columns and rows are pixel centres.
    pub fn project(&self, point_m: [f64; 3]) -> [f64; 2] {
        let [x, y, z] = point_m;
        let bent = self.distortion.distort([x / z, y / z]);
        [0, 1].map(|i| self.focal[i] * bent[i] + self.center[i])
    }

    /// Ray of a pixel as x / z and y / z; `None` outside the camera model.
    pub fn ray(&self, column: f64, row: f64) -> Option<[f64; 2]> {
        let place = [column, row];
        let bent = [0, 1].map(|i| (place[i] - self.center[i]) / self.focal[i]);
        self.distortion.undistort(bent)
    }

    /// Rays of all pixels, row by row; NaN outside the camera model.
    pub fn rays(&self) -> Vec<[f32; 2]> {
        let rows = 0..self.height;
        let places = rows.flat_map(|row| (0..self.width).map(move |column| (column, row)));
        let ray = |(column, row)| {
            let ray = self.ray(f64::from(column), f64::from(row));
            ray.map_or([f32::NAN; 2], |ray| ray.map(|v| v as f32))
        };
        places.map(ray).collect()
    }
}
