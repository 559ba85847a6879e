//! Parameters of the transformer.

use lattice_core::cloud::{TimeOptions, TimeReference, TimeUnit};
use lattice_core::geodesy::{Geodetic, InsMount};
use nalgebra::Vector3;

use super::ins::{HeightDatum, InsOptions, InsSource, InsStamp};
use crate::convert::cloud::Precision;
use crate::convert::viewpoint::VIEWPOINT_FIELDS;
use lattice_runtime::params::{ParamError, Params};

/// Everything that an [`super::EnuTransformer`] can be told.
#[derive(Clone, Debug)]
pub struct TransformerOptions {
    /// How poses come.
    pub ins: InsOptions,
    /// Frame of the output.
    pub map_frame: String,
    /// Frame of the machine.
    pub base_frame: String,
    /// If set, `map` -> this frame is published and `base_frame` is found below it.
    pub odom_frame: Option<String>,
    /// Frame of the earth (ECEF), for the static transform of a georeferenced map.
    pub earth_frame: String,
    /// Whether transforms are published at all.
    pub publish_tf: bool,
    /// Points nearer to the sensor are left out, in m.
    pub min_range_m: f64,
    /// Points farther from the sensor are left out, in m.
    pub max_range_m: f64,
    /// Most points of one cloud.
    pub max_cloud_points: usize,
    /// How per-point times are found and read.
    pub time: TimeOptions,
    /// Whether points are moved to where they were at their own time.
    pub deskew: bool,
    /// How long a cloud waits for the pose that covers it, in s of message time.
    pub max_wait_s: f64,
    /// Longest gap between two poses that is interpolated, in s.
    pub max_pose_gap_s: f64,
    /// How long poses and mounts are kept, in s.
    pub pose_span_s: f64,
    /// Most clouds that wait.
    pub max_waiting_clouds: usize,
    /// Most bytes of clouds that wait.
    pub max_waiting_bytes: usize,
    /// How coordinates are written.
    pub precision: Precision,
    /// Fields of the clouds that `points_enu` keeps, where they have them.
    pub pass_fields: Vec<String>,
    /// Whether `points_enu` says for each point where the sensor was, which a mapper of free space
    /// needs.
    pub viewpoints: bool,
}

/// More than any cloud has that a map needs.
const MAX_PASS_FIELDS: usize = 64;

/// Labels, and what they are worth.
const LABEL_FIELDS: [&str; 3] = ["label", "confidence", "label_probs"];

impl TransformerOptions {
    /// Defaults for a source: `map`, `base_link`, no range limits.
    pub fn new(source: InsSource) -> Self {
        Self {
            ins: InsOptions {
                source,
                stamp: InsStamp::Gps,
                leap_seconds: 18,
                inspvax_height: HeightDatum::Geoid,
                mount: InsMount::new(Vector3::zeros(), [0.0; 3]),
                origin: None,
                base_frame: "base_link".into(),
                max_imu_gap_s: 0.1,
            },
            map_frame: "map".into(),
            base_frame: "base_link".into(),
            odom_frame: None,
            earth_frame: "earth".into(),
            publish_tf: true,
            min_range_m: 0.0,
            max_range_m: f64::INFINITY,
            max_cloud_points: 4_000_000,
            time: TimeOptions::default(),
            deskew: true,
            max_wait_s: 1.0,
            max_pose_gap_s: 0.25,
            pose_span_s: 10.0,
            max_waiting_clouds: 512,
            max_waiting_bytes: 256 << 20,
            precision: Precision::Float32,
            pass_fields: LABEL_FIELDS.map(str::to_owned).into(),
            viewpoints: false,
        }
    }

    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let source: InsSource = choice(params, "ins.source", "inspvax", str::parse)?;
        let mut options = Self::new(source);
        options.ins = ins_options(params, options.ins)?;
        options.map_frame = frame(params, "map_frame", &options.map_frame)?;
        options.base_frame = frame(params, "base_frame", &options.base_frame)?;
        options.ins.base_frame.clone_from(&options.base_frame);
        options.earth_frame = frame(params, "earth_frame", &options.earth_frame)?;
        options.odom_frame = Some(frame(params, "odom_frame", "")?).filter(|f| !f.is_empty());
        options.publish_tf = params.bool("publish_tf", options.publish_tf)?;
        options.min_range_m = positive(params, "min_range_m", 0.0)?;
        let max_range_m = positive(params, "max_range_m", 0.0)?;
        if max_range_m > 0.0 {
            options.max_range_m = max_range_m;
        }
        options.max_cloud_points = params.usize("max_cloud_points", options.max_cloud_points)?;
        options.deskew = params.bool("deskew", options.deskew)?;
        options.time = time_options(params)?;
        options.max_wait_s = positive(params, "max_wait_s", options.max_wait_s)?;
        options.max_pose_gap_s = positive(params, "max_pose_gap_s", options.max_pose_gap_s)?;
        options.pose_span_s = positive(params, "pose_span_s", options.pose_span_s)?;
        options.max_waiting_clouds =
            params.usize("max_waiting_clouds", options.max_waiting_clouds)?;
        options.max_waiting_bytes = params.usize("max_waiting_bytes", options.max_waiting_bytes)?;
        options.precision = choice(params, "precision", "float32", |text| match text {
            "float32" => Ok(Precision::Float32),
            "float64" => Ok(Precision::Float64),
            _ => Err(format!("'{text}', expected float32 or float64")),
        })?;
        options.pass_fields = params.string_array("pass_fields", &LABEL_FIELDS)?;
        if options.pass_fields.len() > MAX_PASS_FIELDS {
            let problem = format!("expected at most {MAX_PASS_FIELDS} names");
            return Err(params.invalid("pass_fields", problem));
        }
        options.viewpoints = params.bool("viewpoints", options.viewpoints)?;
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
    let origin = choice(params, "origin.mode", "first_fix", |text| match text {
        "first_fix" => Ok(false),
        "fixed" => Ok(true),
        _ => Err(format!("'{text}', expected first_fix or fixed")),
    })?;
    let latitude = params.f64("origin.latitude_deg", 0.0)?;
    let longitude = params.f64("origin.longitude_deg", 0.0)?;
    let height_m = params.f64("origin.height_m", 0.0)?;
    let origin = if origin {
        let place = Geodetic::from_degrees(latitude, longitude, height_m)
            .map_err(|e| params.invalid("origin", e.to_string()))?;
        Some(place)
    } else {
        None
    };
    let leap_seconds = params.i64("ins.leap_seconds", i64::from(defaults.leap_seconds))?;
    Ok(InsOptions {
        stamp: choice(params, "ins.stamp", "gps", |text| match text {
            "gps" => Ok(InsStamp::Gps),
            "header" => Ok(InsStamp::Header),
            _ => Err(format!("'{text}', expected gps or header")),
        })?,
        leap_seconds: i32::try_from(leap_seconds)
            .map_err(|_| params.invalid("ins.leap_seconds", "expected a small number, 18"))?,
        inspvax_height: choice(params, "ins.inspvax_height", "geoid", |text| match text {
            "geoid" => Ok(HeightDatum::Geoid),
            "ellipsoid" => Ok(HeightDatum::Ellipsoid),
            _ => Err(format!("'{text}', expected geoid or ellipsoid")),
        })?,
        mount: InsMount::new(
            Vector3::from(triple(params, "ins.lever_arm_m")?),
            triple(params, "ins.boresight_rpy_rad")?,
        ),
        origin,
        max_imu_gap_s: positive(params, "ins.max_imu_gap_s", defaults.max_imu_gap_s)?,
        ..defaults
    })
}

fn time_options(params: &Params) -> Result<TimeOptions, ParamError> {
    let field = params.string("time.field", "")?;
    Ok(TimeOptions {
        field: Some(field).filter(|f| !f.is_empty()),
        unit: choice(params, "time.unit", "auto", |text| match text {
            "auto" => Ok(None),
            "s" => Ok(Some(TimeUnit::Seconds)),
            "ns" => Ok(Some(TimeUnit::Nanoseconds)),
            _ => Err(format!("'{text}', expected auto, s or ns")),
        })?,
        reference: choice(params, "time.reference", "auto", |text| match text {
            "auto" => Ok(None),
            "stamp_start" => Ok(Some(TimeReference::StampStart)),
            "stamp_end" => Ok(Some(TimeReference::StampEnd)),
            "absolute" => Ok(Some(TimeReference::Absolute)),
            _ => Err(format!(
                "'{text}', expected auto, stamp_start, stamp_end or absolute"
            )),
        })?,
        max_span_s: positive(params, "time.max_span_s", TimeOptions::default().max_span_s)?,
    })
}

fn choice<T>(
    params: &Params,
    name: &str,
    default: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<T, ParamError> {
    let text = params.string(name, default)?;
    parse(&text).map_err(|reason| params.invalid(name, reason))
}

fn positive(params: &Params, name: &str, default: f64) -> Result<f64, ParamError> {
    let value = params.f64(name, default)?;
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err(params.invalid(name, format!("{value}, expected zero or more")))
    }
}

fn triple(params: &Params, name: &str) -> Result<[f64; 3], ParamError> {
    let values = params.f64_array(name, &[0.0; 3])?;
    <[f64; 3]>::try_from(values)
        .ok()
        .filter(|values| values.iter().all(|v| v.is_finite()))
        .ok_or_else(|| params.invalid(name, "expected three finite numbers"))
}

fn frame(params: &Params, name: &str, default: &str) -> Result<String, ParamError> {
    Ok(params
        .string(name, default)?
        .trim_start_matches('/')
        .to_owned())
}
