//! Machine poses in the map from INS messages.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use lattice_core::geodesy::{EnuFrame, Geodetic, enu_from_flu, utc_ns_from_gps};
use lattice_core::pose::AttitudeConvention;
use lattice_msgs::RosMessage;
use lattice_msgs::geometry_msgs::{Pose, PoseStamped, PoseWithCovarianceStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVA, INSPVAX, InertialSolutionStatus, Oem7Header};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix, NavSatStatus};
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::fixes::{Attitude, Fix, FixPairing};
pub use super::ins_refusal::InsRefusal;
use crate::convert::geometry;

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
    fn enu(&self, attitude: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
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

/// An INS message.
#[derive(Clone, Copy, Debug)]
pub enum InsMessage<'a> {
    /// NovAtel.
    Inspva(&'a INSPVA),
    /// NovAtel, extended.
    Inspvax(&'a INSPVAX),
    /// Position, paired with [`InsMessage::Imu`].
    Fix(&'a NavSatFix),
    /// Attitude.
    Imu(&'a Imu),
    /// Pose of its `child_frame_id` in the header's frame.
    Odometry(&'a Odometry),
    /// Pose of the machine in the header's frame.
    Pose(&'a PoseStamped),
    /// Pose of the machine in the header's frame.
    PoseWithCovariance(&'a PoseWithCovarianceStamped),
}

/// Frame of the position or attitude in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Body {
    /// The machine: no mount applies.
    Base,
    /// An INS in this frame, without leading slash; empty if the message names none.
    Ins(Arc<str>),
}

impl Body {
    pub(super) fn ins(frame: &str) -> Self {
        Self::Ins(frame.trim_start_matches('/').into())
    }
}

/// Pose from a message, before its mount and reference frame are applied.
#[derive(Clone, Debug)]
pub struct BodyPose {
    /// Nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Reference frame, without leading slash; `None`: the map frame.
    pub reference: Option<Arc<str>>,
    /// `reference_from_body`: position of the first body, attitude of the second; metres.
    pub pose: Isometry3<f64>,
    /// Frame of the position.
    pub position_of: Body,
    /// Frame of the attitude.
    pub attitude_of: Body,
}

/// Converts INS messages to poses of its frames.
pub struct InsDecoder {
    options: InsOptions,
    frame: Option<EnuFrame>,
    pairing: FixPairing,
}

impl InsDecoder {
    /// Decoder without input.
    pub fn new(options: InsOptions) -> Self {
        Self {
            frame: options.origin.map(EnuFrame::new),
            pairing: FixPairing::new(&options),
            options,
        }
    }

    /// Rejected messages since the last call that were held at first.
    pub(super) fn take_refused(&mut self) -> Vec<InsRefusal> {
        self.pairing.take_refused()
    }

    /// Map frame on the earth, once known.
    pub fn frame(&self) -> Option<&EnuFrame> {
        self.frame.as_ref()
    }

    /// Poses completed by the message: usually one, none for half a pair, several when an
    /// attitude or a fix completes earlier ones.
    pub fn decode(&mut self, message: InsMessage) -> Result<Vec<BodyPose>, InsRefusal> {
        match message {
            InsMessage::Inspva(m) => {
                let place = self.geodetic(m.latitude, m.longitude, m.height)?;
                let attitude = self.novatel_attitude([m.roll, m.pitch, m.azimuth]);
                self.novatel_pose(&m.header, &m.nov_header, &m.status, &place, &attitude)
            }
            InsMessage::Inspvax(m) => {
                let undulation_m = match self.options.inspvax_height {
                    HeightDatum::Ellipsoid => 0.0,
                    HeightDatum::Geoid => f64::from(m.undulation),
                };
                let place = self.geodetic(m.latitude, m.longitude, m.height + undulation_m)?;
                let attitude = self.novatel_attitude([m.roll, m.pitch, m.azimuth]);
                self.novatel_pose(&m.header, &m.nov_header, &m.ins_status, &place, &attitude)
            }
            InsMessage::Fix(m) => self.on_fix(m),
            InsMessage::Imu(m) => self.on_imu(m),
            InsMessage::Odometry(m) => {
                let child = m.child_frame_id.trim_start_matches('/');
                let body = match child == self.options.base_frame {
                    true => Body::Base,
                    false => Body::ins(child),
                };
                self.one(&m.header, &m.pose.pose, body)
            }
            InsMessage::Pose(m) => self.one(&m.header, &m.pose, Body::ins("")),
            InsMessage::PoseWithCovariance(m) => self.one(&m.header, &m.pose.pose, Body::ins("")),
        }
    }

    fn novatel_attitude(&self, [roll, pitch, azimuth]: [f64; 3]) -> UnitQuaternion<f64> {
        self.options.enu(enu_from_flu(roll, pitch, azimuth))
    }

    fn novatel_pose(
        &mut self,
        header: &Header,
        oem7: &Oem7Header,
        status: &InertialSolutionStatus,
        place: &Geodetic,
        level_from_ins: &UnitQuaternion<f64>,
    ) -> Result<Vec<BodyPose>, InsRefusal> {
        good(status)?;
        if !level_from_ins.coords.iter().all(|v| v.is_finite()) {
            return Err(InsRefusal::Pose);
        }
        let frame = *self.frame.get_or_insert_with(|| EnuFrame::new(*place));
        let position_m = frame.enu_from_geodetic(place);
        let rotation = frame.enu_from_local_level(place) * level_from_ins;
        let body = Body::ins(&header.frame_id);
        Ok(vec![BodyPose {
            stamp_ns: self.novatel_stamp_ns(header, oem7),
            reference: None,
            pose: Isometry3::from_parts(Translation3::from(position_m), rotation),
            position_of: body.clone(),
            attitude_of: body,
        }])
    }

    fn geodetic(
        &self,
        latitude: f64,
        longitude: f64,
        height_m: f64,
    ) -> Result<Geodetic, InsRefusal> {
        let is_origin_near = |origin: &Geodetic| {
            origin.latitude_deg().abs() < 1.0 && origin.longitude_deg().abs() < 1.0
        };
        if latitude == 0.0
            && longitude == 0.0
            && !self.options.origin.as_ref().is_some_and(is_origin_near)
        {
            return Err(InsRefusal::NullIsland);
        }
        if height_m.is_nan() && latitude.is_finite() && longitude.is_finite() {
            return Err(InsRefusal::NoHeight);
        }
        let place = Geodetic::from_degrees(latitude, longitude, height_m);
        place.map_err(|error| InsRefusal::Place {
            problem: error.to_string(),
        })
    }

    fn novatel_stamp_ns(&self, header: &Header, oem7: &Oem7Header) -> i64 {
        match self.options.stamp {
            InsStamp::Header => header.stamp.to_ns(),
            InsStamp::Gps => utc_ns_from_gps(
                u32::from(oem7.gps_week_number),
                oem7.gps_week_milliseconds,
                self.options.leap_seconds,
            ),
        }
    }

    fn on_fix(&mut self, fix: &NavSatFix) -> Result<Vec<BodyPose>, InsRefusal> {
        let status = fix.status.status;
        if status < NavSatStatus::STATUS_FIX {
            return Err(InsRefusal::NoFix { status });
        }
        let place = self.geodetic(fix.latitude, fix.longitude, fix.altitude)?;
        self.pairing.push_fix(Fix {
            stamp_ns: fix.header.stamp.to_ns(),
            place,
            antenna: Body::ins(&fix.header.frame_id),
        });
        Ok(self.pairing.poses(&mut self.frame))
    }

    fn on_imu(&mut self, imu: &Imu) -> Result<Vec<BodyPose>, InsRefusal> {
        // REP 145: -1 means no orientation.
        if imu.orientation_covariance[0] == -1.0 {
            return Err(InsRefusal::NoOrientation);
        }
        let rotation = geometry::rotation_from(&imu.orientation).ok_or(InsRefusal::Pose)?;
        self.pairing.push_attitude(Attitude {
            stamp_ns: imu.header.stamp.to_ns(),
            level_from_imu: self.options.enu(rotation),
            imu: Body::ins(&imu.header.frame_id),
        });
        Ok(self.pairing.poses(&mut self.frame))
    }

    /// Pose of a body in the header's frame.
    fn one(&self, header: &Header, pose: &Pose, body: Body) -> Result<Vec<BodyPose>, InsRefusal> {
        let reference = header.frame_id.trim_start_matches('/');
        let mut pose = geometry::isometry_from_pose(pose).ok_or(InsRefusal::Pose)?;
        pose.rotation = self.options.enu(pose.rotation);
        Ok(vec![BodyPose {
            stamp_ns: header.stamp.to_ns(),
            reference: (!reference.is_empty()).then(|| reference.into()),
            pose,
            position_of: body.clone(),
            attitude_of: body,
        }])
    }
}

fn good(status: &InertialSolutionStatus) -> Result<(), InsRefusal> {
    match status.status {
        InertialSolutionStatus::INS_SOLUTION_GOOD
        | InertialSolutionStatus::INS_SOLUTION_FREE
        | InertialSolutionStatus::INS_ALIGNMENT_COMPLETE => Ok(()),
        status => Err(InsRefusal::NoSolution { status }),
    }
}
