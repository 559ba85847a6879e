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
    /// Such as x, intensity, t.
    pub name: String,
    /// Bytes from the start of the point.
    pub offset: u32,
    /// One of the constants.
    pub datatype: u8,
    /// Elements in the field.
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
    /// Time of acquisition, and frame of the coordinates.
    pub header: Header,
    /// Rows; 1 when unordered.
    pub height: u32,
    /// Points in a row.
    pub width: u32,
    /// Layout of a point.
    pub fields: Vec<PointField>,
    /// Byte order of the numbers.
    pub is_bigendian: bool,
    /// Bytes from point to point.
    pub point_step: u32,
    /// Bytes from row to row.
    pub row_step: u32,
    /// The points, row_step * height bytes.
    pub data: ByteBuf,
    /// True: no point has an invalid (NaN) coordinate.
    pub is_dense: bool,
}

/// One value for each point of a PointCloud.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelFloat32 {
    /// Such as intensity, rgb.
    pub name: String,
    /// As many as points.
    pub values: Vec<f32>,
}

/// Points with named values, replaced by PointCloud2.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud {
    /// Time of acquisition, and frame of the coordinates.
    pub header: Header,
    /// In m.
    pub points: Vec<Point32>,
    /// Further values.
    pub channels: Vec<ChannelFloat32>,
}

/// One turn of a planar laser, in the plane z = 0 of its frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserScan {
    /// Time of the first ray, and frame of the scanner: angles about z, 0 along x.
    pub header: Header,
    /// Angle of the first ray, rad.
    pub angle_min: f32,
    /// Angle of the last ray, rad.
    pub angle_max: f32,
    /// Angle from ray to ray, rad; negative: clockwise.
    pub angle_increment: f32,
    /// Time from ray to ray, s; 0: all at once.
    pub time_increment: f32,
    /// Time from scan to scan, s.
    pub scan_time: f32,
    /// Least valid range, m.
    pub range_min: f32,
    /// Greatest valid range, m.
    pub range_max: f32,
    /// Range of each ray, m (REP 117: infinite no return, minus infinite too near, NaN invalid).
    pub ranges: Vec<f32>,
    /// Of each ray, in units of the scanner; may be empty.
    pub intensities: Vec<f32>,
}

/// Echoes of one ray.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserEcho {
    /// Ranges in m, or intensities; may be empty.
    pub echoes: Vec<f32>,
}

/// One turn of a planar laser with any number of echoes for each ray, in the plane z = 0 of its frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MultiEchoLaserScan {
    /// Time of the first ray, and frame of the scanner: angles about z, 0 along x.
    pub header: Header,
    /// Angle of the first ray, rad.
    pub angle_min: f32,
    /// Angle of the last ray, rad.
    pub angle_max: f32,
    /// Angle from ray to ray, rad; negative: clockwise.
    pub angle_increment: f32,
    /// Time from ray to ray, s; 0: all at once.
    pub time_increment: f32,
    /// Time from scan to scan, s.
    pub scan_time: f32,
    /// Least valid range, m.
    pub range_min: f32,
    /// Greatest valid range, m.
    pub range_max: f32,
    /// Ranges of each ray, m (REP 117: infinite no return, minus infinite too near, NaN invalid).
    pub ranges: Vec<LaserEcho>,
    /// Of each echo, in units of the scanner; may be empty.
    pub intensities: Vec<LaserEcho>,
}

/// An image without compression.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Time of acquisition, and optical frame: x right, y down, z forward.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Pixels in a row.
    pub width: u32,
    /// Encoding of a pixel, such as 16UC1 or mono8.
    pub encoding: String,
    /// Byte order of the numbers, 0 or 1.
    pub is_bigendian: u8,
    /// Bytes from row to row.
    pub step: u32,
    /// The pixels, step * height bytes.
    pub data: ByteBuf,
}

/// Part of an image; all zero is the whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// True: the rectified image is to be cut like this.
    pub do_rectify: bool,
}

/// Map of a camera from rays to pixels. A pixel's whole coordinates are its centre.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Time of acquisition, and optical frame: x right, y down, z forward.
    pub header: Header,
    /// Rows of the whole image.
    pub height: u32,
    /// Pixels in a row of the whole image.
    pub width: u32,
    /// The model of `d`: plumb_bob, rational_polynomial, equidistant.
    pub distortion_model: String,
    /// Parameters of the distortion.
    pub d: Vec<f64>,
    /// Camera matrix of the raw image, row-major; 0 first: not calibrated.
    pub k: [f64; 9],
    /// Rotation from the camera to the rectified one.
    pub r: [f64; 9],
    /// Projection of the rectified image, row-major.
    pub p: [f64; 12],
    /// Pixels in one, 0 as 1.
    pub binning_x: u32,
    /// Rows in one, 0 as 1.
    pub binning_y: u32,
    /// Part of the image that is sent.
    pub roi: RegionOfInterest,
}

/// An image in a compressed format.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Time of acquisition, and frame of the camera.
    pub header: Header,
    /// Such as png or jpeg.
    pub format: String,
    /// The file as bytes.
    pub data: ByteBuf,
}

/// Inertial measurement. Covariances are 3x3 row-major about x, y, z; all zero is unknown, -1 first: no such measurement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// Time, and frame of the sensor.
    pub header: Header,
    /// Sensor in a fixed frame (REP 145: east-north-up).
    pub orientation: Quaternion,
    /// In rad².
    pub orientation_covariance: [f64; 9],
    /// In rad/s.
    pub angular_velocity: Vector3,
    /// In (rad/s)².
    pub angular_velocity_covariance: [f64; 9],
    /// In m/s², gravity included.
    pub linear_acceleration: Vector3,
    /// In (m/s²)².
    pub linear_acceleration_covariance: [f64; 9],
}

/// State of a satellite navigation receiver.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NavSatStatus {
    /// One of STATUS_*.
    pub status: i8,
    /// The systems in use, bits SERVICE_*.
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
    /// Not set.
    pub const STATUS_UNKNOWN: i8 = -2;
    /// No position.
    pub const STATUS_NO_FIX: i8 = -1;
    /// Position without augmentation.
    pub const STATUS_FIX: i8 = 0;
    /// Augmented from satellites.
    pub const STATUS_SBAS_FIX: i8 = 1;
    /// Augmented from the ground.
    pub const STATUS_GBAS_FIX: i8 = 2;
    /// No system named; compare, do not mask.
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

/// Position from satellites, WGS 84.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NavSatFix {
    /// Time, and frame of the antenna.
    pub header: Header,
    /// Fix and systems.
    pub status: NavSatStatus,
    /// In deg, north positive.
    pub latitude: f64,
    /// In deg, east positive.
    pub longitude: f64,
    /// In m above the WGS 84 ellipsoid, NaN where unknown.
    pub altitude: f64,
    /// In m², 3x3 row-major, east north up.
    pub position_covariance: [f64; 9],
    /// One of COVARIANCE_TYPE_*.
    pub position_covariance_type: u8,
}

impl NavSatFix {
    /// Nothing known.
    pub const COVARIANCE_TYPE_UNKNOWN: u8 = 0;
    /// Estimated from dilution of precision.
    pub const COVARIANCE_TYPE_APPROXIMATED: u8 = 1;
    /// Variances known.
    pub const COVARIANCE_TYPE_DIAGONAL_KNOWN: u8 = 2;
    /// All known.
    pub const COVARIANCE_TYPE_KNOWN: u8 = 3;
}
