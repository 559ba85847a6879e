//! Parameters of the server.

use lattice_core::registration::CalibrationOptions;

use crate::convert::semantic::SemanticOptions;
use lattice_runtime::params::{ParamError, Params};

/// When a whole search begins by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchWhen {
    /// With a cloud, as long as it is not known where the headset is.
    Lost,
    /// Only when a client asks.
    Asked,
}

/// What becomes of a request while another one is at work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenBusy {
    /// It is refused.
    Reject,
    /// It takes the place of the other.
    Supersede,
}

/// Everything that a [`super::SemanticIcpServer`] can be told.
#[derive(Clone, Debug)]
pub struct ServerOptions {
    /// Frame of the map, in which the answer is.
    pub map_frame: String,
    /// Frame that clouds must be in.
    pub headset_frame: String,
    /// How clouds are read.
    pub semantic: SemanticOptions,
    /// How calibrations are done.
    pub calibration: CalibrationOptions,
    /// Maps of more voxels are not followed.
    pub max_map_voxels: usize,
    /// When a whole search begins by itself.
    pub search: SearchWhen,
    /// What becomes of a request while another one is at work.
    pub when_busy: WhenBusy,
    /// Clouds of one session that are searched with together, at most.
    pub max_headset_scans: usize,
    /// A cloud replaces the one before unless it is later by this, ns.
    pub headset_scan_period_ns: i64,
    /// Whether the pose is refined by each cloud once it is known.
    pub track: bool,
    /// Searches that must fail in a row before a pose that is tracked is given up.
    pub lost_after: u32,
    /// A look is searched with alone if its share of points on the map is below this share of that of
    /// the calibration: is it mirrored, or the headset elsewhere?
    pub doubt_below: f64,
    /// How long a tracked pose is compared with an old state of the map, ns.
    pub map_refresh_ns: i64,
}

impl Default for ServerOptions {
    fn default() -> Self {
        Self {
            map_frame: "map".into(),
            headset_frame: "headset_origin".into(),
            semantic: SemanticOptions::default(),
            calibration: CalibrationOptions::default(),
            max_map_voxels: 5_000_000,
            search: SearchWhen::Lost,
            when_busy: WhenBusy::Reject,
            max_headset_scans: 3,
            headset_scan_period_ns: 1_000_000_000,
            track: true,
            lost_after: 3,
            doubt_below: 0.7,
            map_refresh_ns: 10_000_000_000,
        }
    }
}

impl ServerOptions {
    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let frame = |name: &str, default: &str| {
            let frame = params.string(name, default)?;
            let frame = frame.trim_start_matches('/').to_owned();
            match frame.is_empty() {
                true => Err(params.invalid(name, "expected a frame")),
                false => Ok(frame),
            }
        };
        let semantic = SemanticOptions::from_params(params)?;
        let calibration = calibration_from(params, &semantic)?;
        let lost_after = params.usize("lost_after", defaults.lost_after as usize)?;
        Ok(Self {
            map_frame: frame("map_frame", &defaults.map_frame)?,
            headset_frame: frame("headset_frame", &defaults.headset_frame)?,
            max_map_voxels: params.usize("max_map_voxels", defaults.max_map_voxels)?,
            search: one_of(
                params,
                "search",
                &[("lost", SearchWhen::Lost), ("asked", SearchWhen::Asked)],
            )?,
            when_busy: one_of(
                params,
                "when_busy",
                &[
                    ("reject", WhenBusy::Reject),
                    ("supersede", WhenBusy::Supersede),
                ],
            )?,
            max_headset_scans: at_least_one(
                params,
                "max_headset_scans",
                defaults.max_headset_scans,
            )?,
            headset_scan_period_ns: (number(params, "headset_scan_period_s", 1.0, 0.0..=1e6)? * 1e9)
                as i64,
            track: params.bool("track", defaults.track)?,
            lost_after: u32::try_from(lost_after.max(1)).unwrap_or(u32::MAX),
            doubt_below: number(params, "doubt_below", defaults.doubt_below, 0.0..=1.0)?,
            map_refresh_ns: (number(params, "map_refresh_s", 10.0, 0.0..=1e6)? * 1e9) as i64,
            semantic,
            calibration,
        })
    }
}

fn calibration_from(
    params: &Params,
    semantic: &SemanticOptions,
) -> Result<CalibrationOptions, ParamError> {
    let d = CalibrationOptions::default();
    let meters = 1e-6..=1e4;
    Ok(CalibrationOptions {
        min_points: params.usize("min_points", d.min_points)?,
        max_points: semantic.max_points,
        registered_points: at_least_one(params, "registered_points", d.registered_points)?,
        noise_m: number(params, "noise_m", d.noise_m, meters.clone())?,
        region_m: number(params, "region_m", d.region_m, 1e-3..=1e4)?,
        scale_sigma: number(params, "scale_sigma", d.scale_sigma, 0.0..=0.5)?,
        gravity_sigma_rad: gravity_sigma_rad(params, d.gravity_sigma_rad)?,
        agreement: number(params, "agreement", d.agreement, 0.0..=1.0)?,
        start_radius_m: number(params, "guess_radius_m", d.start_radius_m, meters.clone())?,
        start_yaw_rad: number(params, "guess_yaw_rad", d.start_yaw_rad, 0.0..=3.2)?,
        min_margin: number(params, "min_margin", d.min_margin, 0.0..=1e9)?,
        min_inliers: number(params, "min_inliers", d.min_inliers, 0.0..=1.0)?,
        max_sigma_m: number(params, "max_sigma_m", d.max_sigma_m, meters)?,
        max_sigma_rad: number(params, "max_sigma_rad", d.max_sigma_rad, 1e-6..=3.2)?,
    })
}

/// Zero in the parameters stands for a frame that does not know where down is.
fn gravity_sigma_rad(params: &Params, default: f64) -> Result<f64, ParamError> {
    let sigma = number(params, "gravity_sigma_rad", default, 0.0..=3.2)?;
    Ok(if sigma > 0.0 { sigma } else { f64::INFINITY })
}

fn number(
    params: &Params,
    name: &str,
    default: f64,
    range: std::ops::RangeInclusive<f64>,
) -> Result<f64, ParamError> {
    let value = params.f64(name, default)?;
    if range.contains(&value) {
        return Ok(value);
    }
    let problem = format!("{value}, expected {} to {}", range.start(), range.end());
    Err(params.invalid(name, problem))
}

fn at_least_one(params: &Params, name: &str, default: usize) -> Result<usize, ParamError> {
    match params.usize(name, default)? {
        0 => Err(params.invalid(name, "expected 1 or more")),
        value => Ok(value),
    }
}

/// One of several words; the first is the default.
fn one_of<T: Copy>(params: &Params, name: &str, words: &[(&str, T)]) -> Result<T, ParamError> {
    let word = params.string(name, words.first().map_or("", |(word, _)| word))?;
    let found = words.iter().find(|(known, _)| *known == word);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        params.invalid(name, format!("{word:?}, expected {}", known.join(" or ")))
    })
}
