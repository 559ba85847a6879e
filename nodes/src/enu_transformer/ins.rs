//! From the messages of an INS to poses of the machine in the map.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use lattice_core::geodesy::{EnuFrame, Geodetic, enu_from_flu, utc_ns_from_gps};
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

/// Messages that carry the pose of the machine.
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
    /// `geometry_msgs/PoseWithCovarianceStamped`, as AMCL and NDT publish it.
    PoseWithCovariance,
    /// Transforms of `/tf` from the map to the machine, by way of any frames.
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

    /// ROS types of its messages; the second one is paired with the first.
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
            format!("'{text}' is not a source, expected one of {names}")
        })
    }
}

/// Source of the stamp of a NovAtel pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsStamp {
    /// `header.stamp`, which in the ROS driver is the time of arrival.
    Header,
    /// GPS week and milliseconds of the log's own header.
    Gps,
}

/// Surface that a NovAtel height is measured from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightDatum {
    /// WGS84 ellipsoid.
    Ellipsoid,
    /// Geoid; the undulation of the message is added.
    Geoid,
}

/// Options for reading an INS.
#[derive(Clone, Debug)]
pub struct InsOptions {
    /// Messages to read.
    pub source: InsSource,
    /// Stamp of NovAtel messages.
    pub stamp: InsStamp,
    /// GPS minus UTC.
    pub leap_seconds: i32,
    /// Height of INSPVAX.
    pub inspvax_height: HeightDatum,
    /// Reference point of the INS in the frame of the machine, m; `None`: that of its frame on tf.
    pub lever_arm_m: Option<Vector3<f64>>,
    /// Rotation of the INS in the frame of the machine; `None`: that of its frame on tf.
    pub base_from_ins: Option<UnitQuaternion<f64>>,
    /// Frame of the machine: odometry of this frame needs no mount.
    pub base_frame: String,
    /// Origin of the map; `None`: the first good fix.
    pub origin: Option<Geodetic>,
    /// Longest gap between two attitudes that a fix may fall into, in s.
    pub max_imu_gap_s: f64,
    /// Longest gap between two fixes over which positions are interpolated at the stamps of the
    /// attitudes, in s.
    pub max_fix_gap_s: f64,
    /// Speed beyond which positions are refused, in m/s.
    pub max_speed_m_per_s: f64,
    /// Time for which positions are to agree on a place that could not be reached, in nanoseconds.
    pub settle_ns: i64,
    /// Step ahead of stamps beyond which three have to agree, in nanoseconds.
    pub ahead_ns: i64,
}

/// One message of an INS.
#[derive(Clone, Copy, Debug)]
pub enum InsMessage<'a> {
    /// NovAtel.
    Inspva(&'a INSPVA),
    /// NovAtel, extended.
    Inspvax(&'a INSPVAX),
    /// Position, to be paired with [`InsMessage::Imu`].
    Fix(&'a NavSatFix),
    /// Attitude.
    Imu(&'a Imu),
    /// Pose of its `child_frame_id` in the frame of its header.
    Odometry(&'a Odometry),
    /// Pose of the machine in the frame of its header.
    Pose(&'a PoseStamped),
    /// Pose of the machine in the frame of its header.
    PoseWithCovariance(&'a PoseWithCovarianceStamped),
}

/// Frame whose position or attitude a message gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Body {
    /// The machine: no mount applies.
    Base,
    /// An INS in this frame, without leading slash; empty where the message names none.
    Ins(Arc<str>),
}

impl Body {
    pub(super) fn ins(frame: &str) -> Self {
        Self::Ins(frame.trim_start_matches('/').into())
    }
}

/// A pose as messages give it: its mount and the place of its reference frame are still to be applied.
#[derive(Clone, Debug)]
pub struct BodyPose {
    /// Nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Frame that the pose is in, without leading slash; `None`: the map frame.
    pub reference: Option<Arc<str>>,
    /// `reference_from_body`: position of the first body, attitude of the second; metres.
    pub pose: Isometry3<f64>,
    /// Frame whose position it is.
    pub position_of: Body,
    /// Frame whose attitude it is.
    pub attitude_of: Body,
}

/// Turns messages of an INS into poses of its frames.
pub struct InsDecoder {
    options: InsOptions,
    frame: Option<EnuFrame>,
    pairing: FixPairing,
}

impl InsDecoder {
    /// A decoder that has seen nothing.
    pub fn new(options: InsOptions) -> Self {
        Self {
            frame: options.origin.map(EnuFrame::new),
            pairing: FixPairing::new(&options),
            options,
        }
    }

    /// Messages refused since the last call that were taken for a while.
    pub(super) fn take_refused(&mut self) -> Vec<InsRefusal> {
        self.pairing.take_refused()
    }

    /// The map frame on the earth, once known.
    pub fn frame(&self) -> Option<&EnuFrame> {
        self.frame.as_ref()
    }

    /// Poses that the message completes: mostly one, none for half a pair, several when an
    /// attitude or a fix completes those before it.
    pub fn decode(&mut self, message: InsMessage) -> Result<Vec<BodyPose>, InsRefusal> {
        match message {
            InsMessage::Inspva(m) => {
                let place = self.geodetic(m.latitude, m.longitude, m.height)?;
                let attitude = enu_from_flu(m.roll, m.pitch, m.azimuth);
                self.novatel_pose(&m.header, &m.nov_header, &m.status, &place, &attitude)
            }
            InsMessage::Inspvax(m) => {
                let undulation_m = match self.options.inspvax_height {
                    HeightDatum::Ellipsoid => 0.0,
                    HeightDatum::Geoid => f64::from(m.undulation),
                };
                let place = self.geodetic(m.latitude, m.longitude, m.height + undulation_m)?;
                let attitude = enu_from_flu(m.roll, m.pitch, m.azimuth);
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
                one(&m.header, &m.pose.pose, body)
            }
            InsMessage::Pose(m) => one(&m.header, &m.pose, Body::ins("")),
            InsMessage::PoseWithCovariance(m) => one(&m.header, &m.pose.pose, Body::ins("")),
        }
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
        // REP 145: minus one says that there is no orientation.
        if imu.orientation_covariance[0] == -1.0 {
            return Err(InsRefusal::NoOrientation);
        }
        let rotation = geometry::rotation_from(&imu.orientation).ok_or(InsRefusal::Pose)?;
        self.pairing.push_attitude(Attitude {
            stamp_ns: imu.header.stamp.to_ns(),
            level_from_imu: rotation,
            imu: Body::ins(&imu.header.frame_id),
        });
        Ok(self.pairing.poses(&mut self.frame))
    }
}

/// The pose of a body in the frame of a header.
fn one(header: &Header, pose: &Pose, body: Body) -> Result<Vec<BodyPose>, InsRefusal> {
    let reference = header.frame_id.trim_start_matches('/');
    Ok(vec![BodyPose {
        stamp_ns: header.stamp.to_ns(),
        reference: (!reference.is_empty()).then(|| reference.into()),
        pose: geometry::isometry_from_pose(pose).ok_or(InsRefusal::Pose)?,
        position_of: body.clone(),
        attitude_of: body,
    }])
}

fn good(status: &InertialSolutionStatus) -> Result<(), InsRefusal> {
    match status.status {
        InertialSolutionStatus::INS_SOLUTION_GOOD
        | InertialSolutionStatus::INS_SOLUTION_FREE
        | InertialSolutionStatus::INS_ALIGNMENT_COMPLETE => Ok(()),
        status => Err(InsRefusal::NoSolution { status }),
    }
}
