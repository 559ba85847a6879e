//! Facts of the simulated log, as constants that parameter files are checked against.

use crate::simulate::Laser;
use lattice_core::geodesy::{GeodesyError, Geodetic, utc_ns_from_gps};

/// Origin of the map: latitude and longitude (deg, WGS84) and height above the ellipsoid (m).
pub const BOBCAT_ORIGIN: [f64; 3] = [-27.5274, 152.9146, 83.25];
/// Geoid above the ellipsoid on the whole site, m: INSPVAX carries `height = ellipsoidal height - undulation`.
pub const BOBCAT_UNDULATION_M: f32 = 42.0;
/// GPS week in which the log starts.
pub const BOBCAT_GPS_WEEK: u32 = 2400;
/// Start of the log in that week, ms; a multiple of the INS period.
pub const BOBCAT_GPS_WEEK_MS: u32 = 120_000_000;
/// GPS minus UTC, s.
pub const BOBCAT_LEAP_SECONDS: i32 = 18;

/// East, north, up about the origin.
pub const MAP_FRAME: &str = "map";
/// The machine: forward, left, up, on the ground in the middle of the wheels.
pub const BASE_FRAME: &str = "base_link";
/// The INS: axes of `base_link`, at the lever arm.
pub const IMU_FRAME: &str = "imu";
/// The turning part under the top laser.
pub const TURNTABLE_FRAME: &str = "top_turntable";

/// Topic of the NovAtel solution.
pub const INSPVAX_TOPIC: &str = "/novatel/oem7/inspvax";
/// Topic of the same pose as odometry.
pub const ODOMETRY_TOPIC: &str = "/ins/odometry";
/// Topic of the turntable.
pub const TF_TOPIC: &str = "/tf";
/// Topic of the fixed mounts.
pub const TF_STATIC_TOPIC: &str = "/tf_static";

/// Topic of a laser's clouds.
pub fn points_topic(laser: Laser) -> &'static str {
    match laser {
        Laser::Left => "/left/points",
        Laser::Right => "/right/points",
        Laser::Top => "/top/points",
    }
}

/// Topic of a laser's scans, in a log of them.
pub fn scan_topic(laser: Laser) -> &'static str {
    match laser {
        Laser::Left => "/left/scan",
        Laser::Right => "/right/scan",
        Laser::Top => "/top/scan",
    }
}

/// Start of the log, UTC, ns since the Unix epoch.
pub fn bobcat_start_ns() -> i64 {
    utc_ns_from_gps(BOBCAT_GPS_WEEK, BOBCAT_GPS_WEEK_MS, BOBCAT_LEAP_SECONDS)
}

/// The origin as a place.
pub fn bobcat_origin() -> Result<Geodetic, GeodesyError> {
    let [latitude_deg, longitude_deg, height_m] = BOBCAT_ORIGIN;
    Geodetic::from_degrees(latitude_deg, longitude_deg, height_m)
}
