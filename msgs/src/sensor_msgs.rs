//! Point clouds, laser scans, images, inertial and satellite measurements.

use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;

use crate::geometry_msgs::{Point32, Quaternion, Vector3};
use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "sensor_msgs" in "../definitions/sensor_msgs/";
    PointField [];
    PointCloud2 [Header, PointField];
    ChannelFloat32 [];
    PointCloud [Header, Point32, ChannelFloat32];
    LaserScan [Header];
    LaserEcho [];
    MultiEchoLaserScan [Header, LaserEcho];
    Image [Header];
    CompressedImage [Header];
    RegionOfInterest [];
    CameraInfo [Header, RegionOfInterest];
    Imu [Header, Quaternion, Vector3];
    NavSatStatus [];
    NavSatFix [Header, NavSatStatus];
}

/// One field of the points of a PointCloud2.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointField {
    /// Name, such as x, intensity or t.
    pub name: String,
    /// Byte offset from the start of the point.
    pub offset: u32,
    /// Type of an element: one of the constants of this struct.
    pub datatype: u8,
    /// Number of elements.
    pub count: u32,
}

impl PointField {
    /// Signed, 1 byte.
    pub const INT8: u8 = 1;
    /// Unsigned, 1 byte.
    pub const UINT8: u8 = 2;
    /// Signed, 2 bytes.
    pub const INT16: u8 = 3;
    /// Unsigned, 2 bytes.
    pub const UINT16: u8 = 4;
    /// Signed, 4 bytes.
    pub const INT32: u8 = 5;
    /// Unsigned, 4 bytes.
    pub const UINT32: u8 = 6;
    /// IEEE 754, 4 bytes.
    pub const FLOAT32: u8 = 7;
    /// IEEE 754, 8 bytes.
    pub const FLOAT64: u8 = 8;
}

/// Points as packed binary records.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud2 {
    /// Acquisition time and frame of the coordinates.
    pub header: Header,
    /// Number of rows; 1 if the cloud is unordered.
    pub height: u32,
    /// Number of points per row.
    pub width: u32,
    /// Layout of a point.
    pub fields: Vec<PointField>,
    /// True if the numbers are big-endian.
    pub is_bigendian: bool,
    /// Bytes per point.
    pub point_step: u32,
    /// Bytes per row.
    pub row_step: u32,
    /// Point data, `row_step * height` bytes.
    pub data: ByteBuf,
    /// True if no point has an invalid (NaN) coordinate.
    pub is_dense: bool,
}

/// One value for each point of a PointCloud.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelFloat32 {
    /// Name, such as intensity or rgb.
    pub name: String,
    /// Value of each point, in the order of the points.
    pub values: Vec<f32>,
}

/// Point cloud with named channels; deprecated in favour of [`PointCloud2`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud {
    /// Acquisition time and frame of the coordinates.
    pub header: Header,
    /// Coordinates, m.
    pub points: Vec<Point32>,
    /// Channels with one value per point.
    pub channels: Vec<ChannelFloat32>,
}

/// One sweep of a planar laser scanner, in the plane z = 0 of its frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserScan {
    /// Time of the first ray, and frame of the scanner: angles are about z, 0 along x.
    pub header: Header,
    /// Angle of the first ray, rad.
    pub angle_min: f32,
    /// Angle of the last ray, rad.
    pub angle_max: f32,
    /// Angle between consecutive rays, rad; negative if clockwise.
    pub angle_increment: f32,
    /// Time between consecutive rays, s; 0 if all are simultaneous.
    pub time_increment: f32,
    /// Time between scans, s.
    pub scan_time: f32,
    /// Minimum valid range, m.
    pub range_min: f32,
    /// Maximum valid range, m.
    pub range_max: f32,
    /// Range of each ray, m (REP 117: +inf without a return, -inf if too near, NaN if invalid).
    pub ranges: Vec<f32>,
    /// Intensity of each ray, in device-specific units; may be empty.
    pub intensities: Vec<f32>,
}

/// Echoes of one ray.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserEcho {
    /// Ranges in m, or intensities; may be empty.
    pub echoes: Vec<f32>,
}

/// One sweep of a planar laser scanner with any number of echoes per ray, in the plane z = 0 of its frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MultiEchoLaserScan {
    /// Time of the first ray, and frame of the scanner: angles are about z, 0 along x.
    pub header: Header,
    /// Angle of the first ray, rad.
    pub angle_min: f32,
    /// Angle of the last ray, rad.
    pub angle_max: f32,
    /// Angle between consecutive rays, rad; negative if clockwise.
    pub angle_increment: f32,
    /// Time between consecutive rays, s; 0 if all are simultaneous.
    pub time_increment: f32,
    /// Time between scans, s.
    pub scan_time: f32,
    /// Minimum valid range, m.
    pub range_min: f32,
    /// Maximum valid range, m.
    pub range_max: f32,
    /// Ranges of each ray, m (REP 117: +inf without a return, -inf if too near, NaN if invalid).
    pub ranges: Vec<LaserEcho>,
    /// Intensities of each ray, in device-specific units; may be empty.
    pub intensities: Vec<LaserEcho>,
}

/// Uncompressed image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Acquisition time and optical frame: x right, y down, z forward.
    pub header: Header,
    /// Number of rows.
    pub height: u32,
    /// Number of pixels per row.
    pub width: u32,
    /// Encoding of a pixel, such as 16UC1 or mono8.
    pub encoding: String,
    /// Byte order of the pixel values: 1 if big-endian.
    pub is_bigendian: u8,
    /// Bytes per row.
    pub step: u32,
    /// Pixel data, `step * height` bytes.
    pub data: ByteBuf,
}

/// Rectangle of an image; all zero means the whole image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column, pixels.
    pub x_offset: u32,
    /// First row, pixels.
    pub y_offset: u32,
    /// Number of rows; 0 means all.
    pub height: u32,
    /// Number of columns; 0 means all.
    pub width: u32,
    /// True if the rectified image is to be cropped to this rectangle.
    pub do_rectify: bool,
}

/// Calibration of a camera. Integer pixel coordinates are pixel centres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Acquisition time and optical frame: x right, y down, z forward.
    pub header: Header,
    /// Number of rows of the full image.
    pub height: u32,
    /// Number of pixels per row of the full image.
    pub width: u32,
    /// Distortion model: plumb_bob, rational_polynomial or equidistant.
    pub distortion_model: String,
    /// Distortion coefficients of that model.
    pub d: Vec<f64>,
    /// Intrinsic camera matrix of the raw image, 3 x 3, row-major, pixels; `k[0]` is 0 if the camera is not
    /// calibrated.
    pub k: [f64; 9],
    /// Rotation from the camera frame to the rectified frame, 3 x 3, row-major.
    pub r: [f64; 9],
    /// Projection matrix of the rectified image, 3 x 4, row-major, pixels.
    pub p: [f64; 12],
    /// Horizontal binning: raw pixels per pixel; 0 means 1.
    pub binning_x: u32,
    /// Vertical binning: raw rows per row; 0 means 1.
    pub binning_y: u32,
    /// Transmitted rectangle of the image, in raw pixels.
    pub roi: RegionOfInterest,
}

/// Compressed image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Acquisition time and frame of the camera.
    pub header: Header,
    /// Format, such as png or jpeg.
    pub format: String,
    /// Bytes of the compressed file.
    pub data: ByteBuf,
}

/// Inertial measurement. Covariances are 3 x 3, row-major, about x, y, z: all zero if unknown, -1 first if there is
/// no such measurement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// Acquisition time and frame of the sensor.
    pub header: Header,
    /// Orientation of the sensor in a world-fixed frame (REP 145: east-north-up).
    pub orientation: Quaternion,
    /// Covariance of the orientation, rad².
    pub orientation_covariance: [f64; 9],
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3,
    /// Covariance of the angular velocity, (rad/s)².
    pub angular_velocity_covariance: [f64; 9],
    /// Linear acceleration, gravity not removed, m/s².
    pub linear_acceleration: Vector3,
    /// Covariance of the linear acceleration, (m/s²)².
    pub linear_acceleration_covariance: [f64; 9],
}

/// State of a satellite navigation receiver.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NavSatStatus {
    /// Fix status, one of STATUS_*.
    pub status: i8,
    /// Satellite systems in use, a bit mask of SERVICE_*.
    pub service: u16,
}

impl Default for NavSatStatus {
    fn default() -> Self {
        Self {
            status: -2,
            service: 0,
        }
    }
}

impl NavSatStatus {
    /// Status not set.
    pub const STATUS_UNKNOWN: i8 = -2;
    /// No position.
    pub const STATUS_NO_FIX: i8 = -1;
    /// Position without augmentation.
    pub const STATUS_FIX: i8 = 0;
    /// Position with satellite-based augmentation.
    pub const STATUS_SBAS_FIX: i8 = 1;
    /// Position with ground-based augmentation.
    pub const STATUS_GBAS_FIX: i8 = 2;
    /// Unknown systems; a value, not a bit.
    pub const SERVICE_UNKNOWN: u16 = 0;
    /// GPS bit.
    pub const SERVICE_GPS: u16 = 1;
    /// GLONASS bit.
    pub const SERVICE_GLONASS: u16 = 2;
    /// BeiDou bit.
    pub const SERVICE_COMPASS: u16 = 4;
    /// Galileo bit.
    pub const SERVICE_GALILEO: u16 = 8;
}

/// Position from satellite navigation, WGS 84.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NavSatFix {
    /// Acquisition time and frame of the antenna.
    pub header: Header,
    /// Fix status and satellite systems.
    pub status: NavSatStatus,
    /// Latitude, degrees, north positive.
    pub latitude: f64,
    /// Longitude, degrees, east positive.
    pub longitude: f64,
    /// Height above the WGS 84 ellipsoid, m; NaN if unknown.
    pub altitude: f64,
    /// Covariance of the position, 3 x 3, row-major, east-north-up, m².
    pub position_covariance: [f64; 9],
    /// Kind of the covariance, one of COVARIANCE_TYPE_*.
    pub position_covariance_type: u8,
}

impl NavSatFix {
    /// Unknown covariance.
    pub const COVARIANCE_TYPE_UNKNOWN: u8 = 0;
    /// Covariance estimated from the dilution of precision.
    pub const COVARIANCE_TYPE_APPROXIMATED: u8 = 1;
    /// Known variances on the diagonal.
    pub const COVARIANCE_TYPE_DIAGONAL_KNOWN: u8 = 2;
    /// Fully known covariance.
    pub const COVARIANCE_TYPE_KNOWN: u8 = 3;
}
