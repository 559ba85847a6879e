//! From the messages of an INS to poses of the machine in the map.

use std::collections::VecDeque;
use std::fmt;
use std::str::FromStr;

use lattice_core::geodesy::{EnuFrame, Geodetic, InsMount, enu_from_flu, utc_ns_from_gps};
use lattice_core::pose::{PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose};
use lattice_msgs::RosMessage;
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVA, INSPVAX, InertialSolutionStatus, Oem7Header};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix, NavSatStatus};
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::convert::geometry;

/// Most fixes that wait for the attitude at their stamp.
const MAX_WAITING_FIXES: usize = 64;

/// Messages that carry the pose of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsSource {
    /// `novatel_oem7_msgs/INSPVA`: geodetic, ellipsoidal height.
    Inspva,
    /// `novatel_oem7_msgs/INSPVAX`: geodetic, height above the geoid and its undulation.
    Inspvax,
    /// `sensor_msgs/NavSatFix` with `sensor_msgs/Imu`: geodetic, paired by stamp.
    NavsatfixImu,
    /// `nav_msgs/Odometry`, in the map frame.
    Odometry,
    /// `geometry_msgs/PoseStamped`, in the map frame.
    Pose,
    /// Transforms of `/tf` from the map to the machine, by way of any frames.
    Tf,
}

impl InsSource {
    const ALL: [(Self, &'static str); 6] = [
        (Self::Inspva, "inspva"),
        (Self::Inspvax, "inspvax"),
        (Self::NavsatfixImu, "navsatfix_imu"),
        (Self::Odometry, "odometry"),
        (Self::Pose, "pose"),
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
    /// Place of the INS on the machine.
    pub mount: InsMount,
    /// Frame of the machine: odometry of this frame needs no lever arm.
    pub base_frame: String,
    /// Origin of the map; `None`: the first good fix.
    pub origin: Option<Geodetic>,
    /// Longest gap between two attitudes that a fix may fall into, in s.
    pub max_imu_gap_s: f64,
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
    /// Pose in the map frame.
    Odometry(&'a Odometry),
    /// Pose in the map frame.
    Pose(&'a PoseStamped),
}

/// Reason for which a message gave no pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsRefusal {
    /// The INS says that its solution is not good, or has no fix.
    NotGood,
    /// Numbers without meaning, or no orientation.
    Invalid,
}

/// Turns messages of an INS into poses of `base_link` in the map.
pub struct InsDecoder {
    options: InsOptions,
    frame: Option<EnuFrame>,
    attitudes: PoseBuffer,
    fixes: VecDeque<(i64, Geodetic)>,
}

impl InsDecoder {
    /// A decoder that has seen nothing.
    pub fn new(options: InsOptions) -> Self {
        let attitudes = PoseBuffer::new(PoseBufferOptions {
            span_s: 2.0,
            max_gap_s: options.max_imu_gap_s,
            max_poses: 4096,
            jump_back_s: 1.0,
        });
        Self {
            frame: options.origin.map(EnuFrame::new),
            options,
            attitudes,
            fixes: VecDeque::new(),
        }
    }

    /// The map frame on the earth, once known.
    pub fn frame(&self) -> Option<&EnuFrame> {
        self.frame.as_ref()
    }

    /// Poses that the message completes: mostly one, none for half a pair, several when an
    /// attitude brings those of several fixes.
    pub fn decode(&mut self, message: InsMessage) -> Result<Vec<StampedPose>, InsRefusal> {
        match message {
            InsMessage::Inspva(m) => {
                let place = geodetic(m.latitude, m.longitude, m.height)?;
                good(&m.status)?;
                let attitude = enu_from_flu(m.roll, m.pitch, m.azimuth);
                let stamp_ns = self.novatel_stamp_ns(&m.header, &m.nov_header);
                self.pose_at_place(stamp_ns, &place, &attitude)
            }
            InsMessage::Inspvax(m) => {
                let undulation_m = match self.options.inspvax_height {
                    HeightDatum::Ellipsoid => 0.0,
                    HeightDatum::Geoid => f64::from(m.undulation),
                };
                let place = geodetic(m.latitude, m.longitude, m.height + undulation_m)?;
                good(&m.ins_status)?;
                let attitude = enu_from_flu(m.roll, m.pitch, m.azimuth);
                let stamp_ns = self.novatel_stamp_ns(&m.header, &m.nov_header);
                self.pose_at_place(stamp_ns, &place, &attitude)
            }
            InsMessage::Fix(m) => self.on_fix(m),
            InsMessage::Imu(m) => self.on_imu(m),
            InsMessage::Odometry(m)
                if m.child_frame_id.trim_start_matches('/') == self.options.base_frame =>
            {
                let pose = geometry::isometry_from_pose(&m.pose.pose);
                Ok(vec![StampedPose {
                    stamp_ns: m.header.stamp.to_ns(),
                    map_from_base: pose.ok_or(InsRefusal::Invalid)?,
                }])
            }
            InsMessage::Odometry(m) => self.pose_in_map(&m.header, &m.pose.pose),
            InsMessage::Pose(m) => self.pose_in_map(&m.header, &m.pose),
        }
    }

    fn pose_in_map(
        &self,
        header: &Header,
        pose: &lattice_msgs::geometry_msgs::Pose,
    ) -> Result<Vec<StampedPose>, InsRefusal> {
        let map_from_ins = geometry::isometry_from_pose(pose).ok_or(InsRefusal::Invalid)?;
        Ok(vec![self.stamped(header.stamp.to_ns(), &map_from_ins)])
    }

    fn pose_at_place(
        &mut self,
        stamp_ns: i64,
        place: &Geodetic,
        level_from_ins: &UnitQuaternion<f64>,
    ) -> Result<Vec<StampedPose>, InsRefusal> {
        if !level_from_ins.coords.iter().all(|v| v.is_finite()) {
            return Err(InsRefusal::Invalid);
        }
        let frame = *self.frame.get_or_insert_with(|| EnuFrame::new(*place));
        let position_m = frame.enu_from_geodetic(place);
        let rotation = frame.enu_from_local_level(place) * level_from_ins;
        let map_from_ins = Isometry3::from_parts(Translation3::from(position_m), rotation);
        Ok(vec![self.stamped(stamp_ns, &map_from_ins)])
    }

    fn stamped(&self, stamp_ns: i64, map_from_ins: &Isometry3<f64>) -> StampedPose {
        let (position, rotation) = (&map_from_ins.translation, &map_from_ins.rotation);
        let mount = &self.options.mount;
        StampedPose {
            stamp_ns,
            map_from_base: mount.map_from_base(&position.vector, rotation),
        }
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

    fn on_fix(&mut self, fix: &NavSatFix) -> Result<Vec<StampedPose>, InsRefusal> {
        if fix.status.status < NavSatStatus::STATUS_FIX {
            return Err(InsRefusal::NotGood);
        }
        let place = geodetic(fix.latitude, fix.longitude, fix.altitude)?;
        if self.fixes.len() >= MAX_WAITING_FIXES {
            self.fixes.pop_front();
        }
        self.fixes.push_back((fix.header.stamp.to_ns(), place));
        self.pair()
    }

    fn on_imu(&mut self, imu: &Imu) -> Result<Vec<StampedPose>, InsRefusal> {
        // REP-145: minus one says that there is no orientation.
        if imu.orientation_covariance[0] == -1.0 {
            return Err(InsRefusal::NotGood);
        }
        let rotation = geometry::rotation_from(&imu.orientation).ok_or(InsRefusal::Invalid)?;
        let outcome = self.attitudes.push(StampedPose {
            stamp_ns: imu.header.stamp.to_ns(),
            map_from_base: Isometry3::from_parts(Translation3::identity(), rotation),
        });
        if outcome == PushOutcome::JumpedBack {
            let newest_ns = imu.header.stamp.to_ns();
            self.fixes.retain(|(stamp_ns, _)| *stamp_ns <= newest_ns);
        }
        self.pair()
    }

    /// Poses of the fixes whose attitude is known by now, in order.
    fn pair(&mut self) -> Result<Vec<StampedPose>, InsRefusal> {
        let mut poses = Vec::new();
        while let Some((stamp_ns, place)) = self.fixes.front().copied() {
            match self.attitudes.at(stamp_ns) {
                Ok(attitude) => {
                    poses.extend(self.pose_at_place(stamp_ns, &place, &attitude.rotation)?);
                }
                Err(PoseMiss::Empty | PoseMiss::AfterEnd { .. }) => break,
                Err(PoseMiss::BeforeStart { .. } | PoseMiss::Gap { .. }) => {}
            }
            self.fixes.pop_front();
        }
        Ok(poses)
    }
}

fn geodetic(latitude: f64, longitude: f64, height_m: f64) -> Result<Geodetic, InsRefusal> {
    Geodetic::from_degrees(latitude, longitude, height_m).map_err(|_| InsRefusal::Invalid)
}

fn good(status: &InertialSolutionStatus) -> Result<(), InsRefusal> {
    match status.status {
        InertialSolutionStatus::INS_SOLUTION_GOOD
        | InertialSolutionStatus::INS_SOLUTION_FREE
        | InertialSolutionStatus::INS_ALIGNMENT_COMPLETE => Ok(()),
        _ => Err(InsRefusal::NotGood),
    }
}
