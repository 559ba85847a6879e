//! Options of the INS decoder.

use std::fmt;
use std::str::FromStr;

use lattice_core::geodesy::Geodetic;
use lattice_core::pose::AttitudeConvention;
use lattice_msgs::RosMessage;
use lattice_msgs::geometry_msgs::{PoseStamped, PoseWithCovarianceStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVA, INSPVAX};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix};
use nalgebra::{UnitQuaternion, Vector3};

/// Message type of the machine's poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsSource {
    /// `novatel_oem7_msgs/INSPVA`: geodetic, ellipsoidal height.
    Inspva,
    /// `novatel_oem7_msgs/INSPVAX`: geodetic, height above the geoid and its undulation.
    Inspvax,
    /// `sensor_msgs/NavSatFix` with `sensor_msgs/Imu`: geodetic, paired by stamp.
    NavsatfixImu,
    /// `nav_msgs/Odometry`.
    Odometry,
    /// `geometry_msgs/PoseStamped`.
    Pose,
    /// `geometry_msgs/PoseWithCovarianceStamped`, as published by AMCL and NDT.
    PoseWithCovariance,
    /// Transforms of `/tf` from the map to the machine, through any frames.
    Tf,
}

impl InsSource {
    const ALL: [(Self, &'static str); 7] = [
        (Self::Inspva, "inspva"),
        (Self::Inspvax, "inspvax"),
        (Self::NavsatfixImu, "navsatfix_imu"),
        (Self::Odometry, "odometry"),
        (Self::Pose, "pose"),
        (Self::PoseWithCovariance, "pose_with_covariance"),
        (Self::Tf, "tf"),
    ];

    /// ROS types of its messages; the second is paired with the first.
    pub fn type_names(self) -> &'static [&'static str] {
        match self {
            Self::Inspva => &[INSPVA::TYPE],
            Self::Inspvax => &[INSPVAX::TYPE],
            Self::NavsatfixImu => &[NavSatFix::TYPE, Imu::TYPE],
            Self::Odometry => &[Odometry::TYPE],
            Self::Pose => &[PoseStamped::TYPE],
            Self::PoseWithCovariance => &[PoseWithCovarianceStamped::TYPE],
            Self::Tf => &[],
        }
    }
}

impl fmt::Display for InsSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(source, _)| source == self);
        f.write_str(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for InsSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name)| *name == text);
        found.map(|(source, _)| *source).ok_or_else(|| {
            let names = Self::ALL.map(|(_, name)| name).join(", ");
            format!("source '{text}' is not one of {names}")
        })
    }
}

/// Stamp of a NovAtel pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsStamp {
    /// `header.stamp`, the time of arrival in the ROS driver.
    Header,
    /// GPS week and milliseconds of the log's header.
    Gps,
}

/// Reference surface of a NovAtel height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightDatum {
    /// WGS84 ellipsoid.
    Ellipsoid,
    /// Geoid; the undulation of the message is added.
    Geoid,
}

/// Options of the INS decoder.
#[derive(Clone, Debug)]
pub struct InsOptions {
    /// Message type.
    pub source: InsSource,
    /// Stamp of NovAtel messages.
    pub stamp: InsStamp,
    /// GPS time minus UTC, s.
    pub leap_seconds: i32,
    /// Height reference of INSPVAX.
    pub inspvax_height: HeightDatum,
    /// Lever arm: reference point of the INS in the machine's frame, m; `None`: from its frame on tf.
    pub lever_arm_m: Option<Vector3<f64>>,
    /// Boresight: rotation of the INS in the machine's frame; `None`: from its frame on tf.
    pub base_from_ins: Option<UnitQuaternion<f64>>,
    /// Convention of quaternions.
    pub orientation: AttitudeConvention,
    /// Yaw added to attitudes, counterclockwise, rad.
    pub yaw_offset_rad: f64,
    /// Frame of the machine: odometry of this frame needs no mount.
    pub base_frame: String,
    /// Origin of the map; `None`: the first good fix.
    pub origin: Option<Geodetic>,
    /// Longest gap between two attitudes around a fix, s.
    pub max_imu_gap_s: f64,
    /// Longest gap between two fixes for the interpolation of positions at the stamps of
    /// attitudes, s.
    pub max_fix_gap_s: f64,
    /// Largest accepted speed, m/s.
    pub max_speed_m_per_s: f64,
    /// Time for which positions must agree on an unreachable position before it is accepted, ns.
    pub settle_ns: i64,
    /// Forward step of stamps beyond which three must agree, ns.
    pub ahead_ns: i64,
}

impl InsOptions {
    /// Attitude of a message as `enu_from_flu`; attitudes in this convention are unchanged to the bit.
    pub(super) fn enu(&self, attitude: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let attitude = match self.orientation {
            AttitudeConvention::Enu => attitude,
            other => other.to_enu(&attitude),
        };
        match self.yaw_offset_rad == 0.0 {
            true => attitude,
            false => UnitQuaternion::from_euler_angles(0.0, 0.0, self.yaw_offset_rad) * attitude,
        }
    }

    /// Parameter that is set but ignored by the source of poses.
    pub fn ignored(&self) -> Option<&'static str> {
        let is_tf = self.source == InsSource::Tf;
        let has_azimuth = matches!(self.source, InsSource::Inspva | InsSource::Inspvax);
        if self.orientation != AttitudeConvention::Enu && (is_tf || has_azimuth) {
            return Some("ins.orientation");
        }
        (self.yaw_offset_rad != 0.0 && is_tf).then_some("ins.yaw_offset_deg")
    }
}
