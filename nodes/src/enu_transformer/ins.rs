//! Machine poses in the map from INS messages.

use lattice_core::geodesy::{EnuFrame, Geodetic, enu_from_flu, utc_ns_from_gps};
use lattice_msgs::geometry_msgs::{Pose, PoseStamped, PoseWithCovarianceStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVA, INSPVAX, InertialSolutionStatus, Oem7Header};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix, NavSatStatus};
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

pub use super::body_pose::{Body, BodyPose};
use super::fixes::{Attitude, Fix, FixPairing};
pub use super::ins_options::{HeightDatum, InsOptions, InsSource, InsStamp};
pub use super::ins_refusal::InsRefusal;
use crate::convert::geometry;

/// An INS message.
#[derive(Clone, Copy, Debug)]
pub enum InsMessage<'a> {
    /// NovAtel INSPVA: position, velocity and attitude.
    Inspva(&'a INSPVA),
    /// NovAtel INSPVAX: INSPVA with standard deviations and status.
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
