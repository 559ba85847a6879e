//! Parameters of the transformer.

use super::ins_options::InsSource;
use super::options::TransformerOptions;
use crate::compute::ComputeLimits;
use crate::options::{self, FRAME, TOPIC};
use crate::report;
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "points_topics" fixed(TOPIC): "Topics of the sensors' clouds: PointCloud2, PointCloud, LaserScan, MultiEchoLaserScan, or CustomMsg of Livox; at least one.";
    "ins.source" fixed(TOPIC): "Source of poses: inspva, inspvax, navsatfix_imu, odometry, pose, pose_with_covariance, or tf (transforms from map_frame to base_frame by other nodes).";
    "ins.topic" fixed(TOPIC): "Topic of the INS; for navsatfix_imu that of the NavSatFix.";
    "ins.imu_topic" fixed(TOPIC): "Topic of the attitude, for navsatfix_imu.";
    "ins.stamp" fixed(POSES): "Stamp of NovAtel poses: gps (week and milliseconds of the log) or header (time of arrival).";
    "ins.leap_seconds" fixed(POSES): "GPS minus UTC, s.";
    "ins.inspvax_height" fixed(POSES): "Reference of the INSPVAX height: geoid (its undulation is added) or ellipsoid.";
    "ins.lever_arm_m" fixed(POSES): "Lever arm: reference point of the INS in base_frame (x forward, y left, z up), in place of that of its frame on tf.";
    "ins.boresight_rpy_rad" fixed(POSES): "Boresight: rotation of the INS in base_frame, fixed-axis roll, pitch, yaw, in place of that of its frame on tf.";
    "ins.orientation" fixed(POSES): "Convention of quaternions: enu (REP 103), ned (north, east, down; x forward, y right, z down), compass (yaw clockwise from north, roll and pitch of REP 103), or enu but for roll and pitch: pitch_up (positive with the nose up), roll_left (positive with the left side down), swapped (exchanged). Not for inspva, inspvax and tf.";
    "ins.yaw_offset_deg" fixed(POSES): "Angle added to the yaw of the poses, counterclockwise: magnetic declination to the east as a negative number, or the turn of an antenna baseline. Not for tf.";
    "ins.max_imu_gap_s" fixed(POSES): "Longest gap between two attitudes around a fix (navsatfix_imu).";
    "ins.max_fix_gap_s" fixed(POSES): "Longest gap between two fixes for interpolating positions at the stamps of attitudes (navsatfix_imu); clouds wait that much longer.";
    "ins.max_speed_m_per_s" fixed(POSES): "Largest speed: poses farther from the previous one than this speed and 1 m allow are rejected, until they have agreed on the new place for half of max_wait_s; 0: no limit. Not for tf.";
    "origin.mode" fixed(POSES): "Origin of the map frame: first_fix (the first good fix) or fixed (the position below).";
    "origin.latitude_deg" fixed(POSES): "Latitude of the fixed origin, WGS84.";
    "origin.longitude_deg" fixed(POSES): "Longitude of the fixed origin, WGS84.";
    "origin.height_m" fixed(POSES): "Height of the fixed origin above the ellipsoid.";
    "correction.translation_m" fixed(POSES): "Translation of a correction of all poses in the map frame, applied after its rotation.";
    "correction.rpy_rad" fixed(POSES): "Rotation of the correction about the origin of the map: fixed-axis roll, pitch, yaw.";
    "map_frame" fixed(FRAME): "East-north-up frame of the map. If set, poses in another frame need a transform to it; otherwise an unconnected frame of poses is used as the map.";
    "base_frame" fixed(FRAME): "Frame of the machine.";
    "earth_frame" fixed(FRAME): "Frame of the earth (ECEF).";
    "odom_frame" fixed(FRAME): "Odometry frame: if set, map -> odom_frame is published instead of map -> base_frame.";
    "publish_tf": "Whether transforms are published.";
    "deskew": "Whether points are motion-compensated by their own times.";
    "time.field": "Field of the time of points; empty: time, t, timestamp, offset_time, ts, stamp and the like, with or without a unit behind the name (_ns, _us, _ms, _s).";
    "time.unit": "auto, s, ms, us or ns.";
    "time.reference": "auto, stamp_start, stamp_end or absolute.";
    "time.max_span_s": "Longest time span of one cloud; a longer one indicates a wrong unit and is rejected, single outlying points are dropped.";
    "time.offset_s" fixed(POSES): "Time added to those of all clouds, where their clock is not that of the poses: -18 if clouds are stamped in GPS time and poses in UTC.";
    "max_wait_s": "Longest wait of a cloud for a covering pose.";
    "max_pose_gap_s": "Longest gap between two poses for interpolation.";
    "pose_span_s" fixed(POSES): "Duration for which poses and dynamic mounts are kept.";
    "max_waiting_clouds": "Limit of queued clouds; the oldest cloud is dropped.";
    "max_waiting_bytes" fixed("the inbox is made with it"): "Limit of queued cloud bytes; the oldest cloud is dropped.";
    "precision": "Coordinate type of points_enu: auto, float32, or float64, which RViz does not draw. auto is float64 for clouds beyond 16 km from the origin, where the float32 error exceeds 0.5 mm.";
    "pass_fields": "Fields of the input clouds copied to points_enu, if present.";
    "viewpoints": "Whether points_enu contains the sensor position of each point (vp_x, vp_y, vp_z), 12 or 24 bytes more; free_space of lattice_mapper needs it.";
};

const POSES: &str = "poses are read and kept with it";

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub transformer: TransformerOptions,
    pub limits: ComputeLimits,
    pub points_topics: Vec<String>,
    pub ins_topic: String,
    pub imu_topic: String,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let transformer = TransformerOptions::from_params(params)?;
        let points_topics = params.string_array("points_topics", &["points"])?;
        if points_topics.iter().all(String::is_empty) {
            return Err(params.invalid("points_topics", "expected at least one topic"));
        }
        Ok(Self {
            limits: ComputeLimits {
                events: options::inbox_events(params, 8192)?,
                bytes: transformer.max_waiting_bytes,
                threads: options::threads(params, 0)?,
            },
            points_topics,
            ins_topic: params.string("ins.topic", "ins")?,
            imu_topic: params.string("ins.imu_topic", "imu")?,
            report_file: report::file(params)?,
            transformer,
        })
    }
}

impl Settings {
    /// Topics and frames in use, for the log.
    pub(super) fn taken(&self) -> String {
        let options = &self.transformer;
        let (ins, imu) = (&self.ins_topic, &self.imu_topic);
        let poses = match options.ins.source {
            InsSource::Tf => "/tf".to_owned(),
            InsSource::NavsatfixImu => format!("{ins} and {imu}"),
            _ => ins.clone(),
        };
        format!(
            "clouds: {}; poses: {poses}, as {}, of {} in {}; transforms: /tf, /tf_static",
            self.points_topics.join(", "),
            options.ins.source,
            options.base_frame,
            options.map_frame
        )
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
