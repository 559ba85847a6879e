//! Parameters of the transformer.

use lattice_core::cloud::{TimeOptions, TimeReference, TimeUnit};
use lattice_core::geodesy::Geodetic;
use lattice_core::pose::AttitudeConvention;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::ins_options::{HeightDatum, InsOptions, InsSource, InsStamp};
use crate::convert::cloud::Precision;
use crate::convert::viewpoint::VIEWPOINT_FIELDS;
use crate::options::{frame, one_of};
use lattice_runtime::params::{ParamError, Params};

/// Options of an [`super::EnuTransformer`].
#[derive(Clone, Debug)]
pub struct TransformerOptions {
    /// Options for reading the INS.
    pub ins: InsOptions,
    /// Frame of the output.
    pub map_frame: String,
    /// True if poses in another frame need a transform to the map frame; else a frame that nothing connects
    /// with it is the map.
    pub map_frame_is_given: bool,
    /// Frame of the machine.
    pub base_frame: String,
    /// If set, `map` -> this frame is published and `base_frame` is found below it.
    pub odom_frame: Option<String>,
    /// Frame of the earth (ECEF), for the static transform of a georeferenced map.
    pub earth_frame: String,
    /// True if transforms are published at all.
    pub publish_tf: bool,
    /// Points nearer to the sensor are left out, in m.
    pub min_range_m: f64,
    /// Points farther from the sensor are left out, in m.
    pub max_range_m: f64,
    /// Most points of one cloud.
    pub max_cloud_points: usize,
    /// Field, unit and reference of the times of points.
    pub time: TimeOptions,
    /// Time added to those of clouds, in ns: their clock is that of the poses then.
    pub time_offset_ns: i64,
    /// True if points are moved to their place at their own time.
    pub deskew: bool,
    /// Longest wait of a cloud for the pose that covers it, in s of message time.
    pub max_wait_s: f64,
    /// Longest gap between two poses that is interpolated, in s.
    pub max_pose_gap_s: f64,
    /// Age up to which poses and mounts are kept, in s.
    pub pose_span_s: f64,
    /// Most clouds that wait.
    pub max_waiting_clouds: usize,
    /// Most bytes of clouds that wait.
    pub max_waiting_bytes: usize,
    /// Type of the coordinates; `None`: as the distance from the origin asks for.
    pub precision: Option<Precision>,
    /// Fields of the clouds that `points_enu` keeps, where they have them.
    pub pass_fields: Vec<String>,
    /// True if each point of `points_enu` has the position of the sensor, for mapping of free space.
    pub viewpoints: bool,
    /// `map_from_map`: correction applied to all poses; `None` if unknown.
    pub correction: Option<Isometry3<f64>>,
}

/// Default speed limit of the machine, above that of road vehicles.
const MAX_SPEED_M_PER_S: f64 = 50.0;

/// Limit of the offset of the times of clouds, s: a day, more than any time zone.
const MAX_OFFSET_S: f64 = 86_400.0;

/// Longest time by which the offset extends the wait of clouds and the span of poses, s: more than the 37 s from UTC to TAI.
const MAX_SPAN_S: f64 = 60.0;

/// Limit of fields passed through.
const MAX_PASS_FIELDS: usize = 64;

/// Default fields passed through: labels with their probabilities, and colours.
const PASS_FIELDS: [&str; 8] = [
    "label",
    "confidence",
    "label_probs",
    "rgb",
    "rgba",
    "r",
    "g",
    "b",
];

impl TransformerOptions {
    /// Defaults for a source: `map`, `base_link`, no range limits.
    pub fn new(source: InsSource) -> Self {
        Self {
            ins: InsOptions {
                source,
                stamp: InsStamp::Gps,
                leap_seconds: 18,
                inspvax_height: HeightDatum::Geoid,
                lever_arm_m: None,
                base_from_ins: None,
                orientation: AttitudeConvention::Enu,
                yaw_offset_rad: 0.0,
                origin: None,
                base_frame: "base_link".into(),
                max_imu_gap_s: 0.1,
                max_fix_gap_s: 1.5,
                max_speed_m_per_s: MAX_SPEED_M_PER_S,
                settle_ns: 500_000_000,
                ahead_ns: 10_000_000_000,
            },
            map_frame: "map".into(),
            map_frame_is_given: false,
            base_frame: "base_link".into(),
            odom_frame: None,
            earth_frame: "earth".into(),
            publish_tf: true,
            min_range_m: 0.0,
            max_range_m: f64::INFINITY,
            max_cloud_points: 4_000_000,
            time: TimeOptions::default(),
            time_offset_ns: 0,
            deskew: true,
            max_wait_s: 1.0,
            max_pose_gap_s: 0.25,
            pose_span_s: 10.0,
            max_waiting_clouds: 512,
            max_waiting_bytes: 256 << 20,
            precision: None,
            pass_fields: PASS_FIELDS.map(str::to_owned).into(),
            viewpoints: false,
            correction: None,
        }
    }

    /// Longest wait of a cloud, s: positions between two fixes are known with the second.
    pub(super) fn longest_wait_s(&self) -> f64 {
        match self.ins.source {
            InsSource::NavsatfixImu => self.max_wait_s + self.ins.max_fix_gap_s,
            _ => self.max_wait_s,
        }
    }

    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let source = params.string("ins.source", "inspvax")?;
        let source: InsSource = source
            .parse()
            .map_err(|problem: String| params.invalid("ins.source", problem))?;
        let mut options = Self::new(source);
        options.ins = ins_options(params, options.ins)?;
        options.map_frame = frame(params, "map_frame", &options.map_frame)?;
        options.map_frame_is_given = params.is_given("map_frame");
        options.base_frame = frame(params, "base_frame", &options.base_frame)?;
        options.ins.base_frame.clone_from(&options.base_frame);
        options.earth_frame = frame(params, "earth_frame", &options.earth_frame)?;
        options.odom_frame = match params.string("odom_frame", "")?.is_empty() {
            true => None,
            false => Some(frame(params, "odom_frame", "")?),
        };
        options.publish_tf = params.bool("publish_tf", options.publish_tf)?;
        options.min_range_m = not_negative(params, "min_range_m", 0.0)?;
        let max_range_m = not_negative(params, "max_range_m", 0.0)?;
        if max_range_m > 0.0 {
            options.max_range_m = max_range_m;
        }
        if options.min_range_m > options.max_range_m {
            let problem = format!("expected at most `max_range_m`, {max_range_m}");
            return Err(params.invalid("min_range_m", problem));
        }
        options.max_cloud_points = params.positive("max_cloud_points", options.max_cloud_points)?;
        options.deskew = params.bool("deskew", options.deskew)?;
        options.time = time_options(params)?;
        let offset_s = params.f64_in("time.offset_s", 0.0, -MAX_OFFSET_S..=MAX_OFFSET_S)?;
        options.time_offset_ns = (offset_s * 1e9).round() as i64;
        // Clouds of a log whose order is that of its stamps come as much before or behind their poses.
        options.max_wait_s += offset_s.clamp(0.0, MAX_SPAN_S);
        options.pose_span_s += (-offset_s).clamp(0.0, MAX_SPAN_S);
        options.max_wait_s = not_negative(params, "max_wait_s", options.max_wait_s)?;
        options.max_pose_gap_s = not_negative(params, "max_pose_gap_s", options.max_pose_gap_s)?;
        options.pose_span_s = not_negative(params, "pose_span_s", options.pose_span_s)?;
        let (clouds, bytes) = (options.max_waiting_clouds, options.max_waiting_bytes);
        options.max_waiting_clouds = params.positive("max_waiting_clouds", clouds)?;
        options.max_waiting_bytes = params.positive("max_waiting_bytes", bytes)?;
        let (single, double) = (Precision::Float32, Precision::Float64);
        let precisions = [
            ("auto", None),
            ("float32", Some(single)),
            ("float64", Some(double)),
        ];
        options.precision = one_of(params, "precision", &precisions)?;
        options.pass_fields = params.string_array("pass_fields", &PASS_FIELDS)?;
        if options.pass_fields.len() > MAX_PASS_FIELDS {
            let problem = format!("expected at most {MAX_PASS_FIELDS} names");
            return Err(params.invalid("pass_fields", problem));
        }
        options.viewpoints = params.bool("viewpoints", options.viewpoints)?;
        options.correction = correction(params)?;
        let mut names = std::collections::BTreeSet::from(["x", "y", "z"]);
        if options.viewpoints {
            names.extend(VIEWPOINT_FIELDS);
        }
        if !options.pass_fields.iter().all(|name| names.insert(name)) {
            let problem = "expected each name once, and not x, y, z or those of viewpoints";
            return Err(params.invalid("pass_fields", problem));
        }
        Ok(options)
    }
}

fn ins_options(params: &Params, defaults: InsOptions) -> Result<InsOptions, ParamError> {
    let modes = [("first_fix", false), ("fixed", true)];
    let is_fixed = one_of(params, "origin.mode", &modes)?;
    let latitude = params.f64("origin.latitude_deg", 0.0)?;
    let longitude = params.f64("origin.longitude_deg", 0.0)?;
    let height_m = params.f64("origin.height_m", 0.0)?;
    let place = Geodetic::from_degrees(latitude, longitude, height_m)
        .map_err(|e| params.invalid("origin", e.to_string()));
    let stamps = [("gps", InsStamp::Gps), ("header", InsStamp::Header)];
    let (geoid, ellipsoid) = (HeightDatum::Geoid, HeightDatum::Ellipsoid);
    let heights = [("geoid", geoid), ("ellipsoid", ellipsoid)];
    let lever_arm_m = Vector3::from(triple(params, "ins.lever_arm_m")?);
    let [roll, pitch, yaw] = triple(params, "ins.boresight_rpy_rad")?;
    let base_from_ins = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let conventions = AttitudeConvention::ALL.map(|one| (one.name(), one));
    let yaw_offset_deg = params.f64_in("ins.yaw_offset_deg", 0.0, -360.0..=360.0)?;
    let leap_seconds = params.i64("ins.leap_seconds", i64::from(defaults.leap_seconds))?;
    let max_speed_m_per_s =
        not_negative(params, "ins.max_speed_m_per_s", defaults.max_speed_m_per_s)?;
    Ok(InsOptions {
        max_speed_m_per_s: match max_speed_m_per_s > 0.0 {
            true => max_speed_m_per_s,
            false => f64::INFINITY,
        },
        stamp: one_of(params, "ins.stamp", &stamps)?,
        leap_seconds: i32::try_from(leap_seconds)
            .map_err(|_| params.invalid("ins.leap_seconds", "expected a small number, 18"))?,
        inspvax_height: one_of(params, "ins.inspvax_height", &heights)?,
        lever_arm_m: params.is_given("ins.lever_arm_m").then_some(lever_arm_m),
        base_from_ins: params
            .is_given("ins.boresight_rpy_rad")
            .then_some(base_from_ins),
        orientation: one_of(params, "ins.orientation", &conventions)?,
        yaw_offset_rad: yaw_offset_deg.to_radians(),
        origin: is_fixed.then_some(place).transpose()?,
        max_imu_gap_s: not_negative(params, "ins.max_imu_gap_s", defaults.max_imu_gap_s)?,
        max_fix_gap_s: params.f64_in("ins.max_fix_gap_s", defaults.max_fix_gap_s, 0.0..=60.0)?,
        ..defaults
    })
}

/// None unless it moves something: the poses keep their bits.
fn correction(params: &Params) -> Result<Option<Isometry3<f64>>, ParamError> {
    let [x, y, z] = triple(params, "correction.translation_m")?;
    let [roll, pitch, yaw] = triple(params, "correction.rpy_rad")?;
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let correction = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
    Ok(Some(correction).filter(|correction| *correction != Isometry3::identity()))
}

/// `time.*`: field, unit and reference of the times of points.
pub(crate) fn time_options(params: &Params) -> Result<TimeOptions, ParamError> {
    let field = params.string("time.field", "")?;
    let units = [
        ("auto", None),
        ("s", Some(TimeUnit::Seconds)),
        ("ms", Some(TimeUnit::Milliseconds)),
        ("us", Some(TimeUnit::Microseconds)),
        ("ns", Some(TimeUnit::Nanoseconds)),
    ];
    let references = [
        ("auto", None),
        ("stamp_start", Some(TimeReference::StampStart)),
        ("stamp_end", Some(TimeReference::StampEnd)),
        ("absolute", Some(TimeReference::Absolute)),
    ];
    let max_span_s = TimeOptions::default().max_span_s;
    Ok(TimeOptions {
        field: Some(field).filter(|f| !f.is_empty()),
        unit: one_of(params, "time.unit", &units)?,
        reference: one_of(params, "time.reference", &references)?,
        max_span_s: not_negative(params, "time.max_span_s", max_span_s)?,
    })
}

fn not_negative(params: &Params, name: &str, default: f64) -> Result<f64, ParamError> {
    params.f64_in(name, default, 0.0..=f64::MAX)
}

fn triple(params: &Params, name: &str) -> Result<[f64; 3], ParamError> {
    let values = params.f64_array(name, &[0.0; 3])?;
    <[f64; 3]>::try_from(values)
        .ok()
        .filter(|values| values.iter().all(|v| v.is_finite()))
        .ok_or_else(|| params.invalid(name, "expected three finite numbers"))
}
