//! Parameters of the server.

use lattice_core::registration::{CalibrationOptions, Profile, SourceCloud};

use crate::convert::semantic::SemanticOptions;
use crate::options::{frame, one_of};
use lattice_runtime::params::{ParamError, Params};

/// Condition for a search without a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchWhen {
    /// At each cloud while the headset's pose is unknown.
    Lost,
    /// Never.
    Asked,
}

/// Policy for a request while another one is in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenBusy {
    /// Reject it.
    Reject,
    /// Cancel the earlier one.
    Supersede,
}

/// Calibration options per profile, where the profile is detected from the clouds; else equal.
#[derive(Clone, Copy, Debug)]
pub struct ByProfile([CalibrationOptions; Profile::ALL.len()]);

/// Options of a [`super::SemanticIcpServer`].
#[derive(Clone, Debug)]
pub struct ServerOptions {
    /// Frame of the map and of the result.
    pub map_frame: String,
    /// Required frame of clouds.
    pub headset_frame: String,
    /// Options for labelled clouds.
    pub semantic: SemanticOptions,
    /// Options of calibrations.
    pub calibration: ByProfile,
    /// Voxel limit of the followed map.
    pub max_map_voxels: usize,
    /// Condition for a search without a request.
    pub search: SearchWhen,
    /// Policy for a request while another one is in progress.
    pub when_busy: WhenBusy,
    /// Limit of clouds of one session per search.
    pub max_headset_scans: usize,
    /// Age below which the newest cloud is replaced by the next one instead of being kept beside it, ns.
    pub headset_scan_period_ns: i64,
    /// True to track the current pose with each cloud.
    pub track: bool,
    /// Consecutive failed searches before a tracked pose is dropped.
    pub lost_after: u32,
    /// Fraction of the calibration's inlier fraction below which a cloud is searched alone: it may be
    /// mirrored, or the headset may have moved.
    pub doubt_below: f64,
    /// Age up to which an outdated map state is used for tracking, ns.
    pub map_refresh_ns: i64,
}

impl Default for ServerOptions {
    fn default() -> Self {
        Self {
            map_frame: "map".into(),
            headset_frame: "headset_origin".into(),
            semantic: SemanticOptions::default(),
            calibration: ByProfile::from(CalibrationOptions::default()),
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
        let semantic = SemanticOptions::from_params(params)?;
        let calibration = ByProfile::from_params(params, &semantic)?;
        let lost_after = defaults.lost_after as usize;
        let lost_after = params.usize_in("lost_after", lost_after, 1..=1 << 20)?;
        let scan_period_s = params.f64_in("headset_scan_period_s", 1.0, 0.0..=1e6)?;
        let searches = [("lost", SearchWhen::Lost), ("asked", SearchWhen::Asked)];
        let (reject, supersede) = (WhenBusy::Reject, WhenBusy::Supersede);
        let busy = [("reject", reject), ("supersede", supersede)];
        Ok(Self {
            map_frame: frame(params, "map_frame", &defaults.map_frame)?,
            headset_frame: frame(params, "headset_frame", &defaults.headset_frame)?,
            max_map_voxels: params.positive("max_map_voxels", defaults.max_map_voxels)?,
            search: one_of(params, "search", &searches)?,
            when_busy: one_of(params, "when_busy", &busy)?,
            max_headset_scans: params.positive("max_headset_scans", defaults.max_headset_scans)?,
            headset_scan_period_ns: (scan_period_s * 1e9) as i64,
            track: params.bool("track", defaults.track)?,
            lost_after: u32::try_from(lost_after).unwrap_or(u32::MAX),
            doubt_below: params.f64_in("doubt_below", defaults.doubt_below, 0.0..=1.0)?,
            map_refresh_ns: (params.f64_in("map_refresh_s", 10.0, 0.0..=1e6)? * 1e9) as i64,
            semantic,
            calibration,
        })
    }
}

impl ByProfile {
    fn from_params(params: &Params, semantic: &SemanticOptions) -> Result<ByProfile, ParamError> {
        let auto = std::iter::once(("auto", None));
        let named = Profile::ALL.map(|profile| (profile.name(), Some(profile)));
        let profiles: Vec<_> = named.into_iter().chain(auto).collect();
        if let Some(profile) = one_of(params, "profile", &profiles)? {
            return calibration_from(params, semantic, profile).map(ByProfile::from);
        }
        // The parameters show those of the first profile.
        let [first, ..] = Profile::ALL;
        let mut options = [calibration_from(params, semantic, first)?; Profile::ALL.len()];
        for (options, profile) in options.iter_mut().zip(Profile::ALL).skip(1) {
            *options = calibration_from(params, semantic, profile)?;
        }
        Ok(ByProfile(options))
    }

    /// Options for clouds.
    pub fn of_clouds(&self, headset_scans: &[SourceCloud]) -> CalibrationOptions {
        let [first, others @ ..] = &self.0;
        match others.iter().all(|other| other.profile == first.profile) {
            true => *first,
            false => self.of_profile(Profile::of(headset_scans)),
        }
    }

    /// Options for a profile; common ones if profiles are not detected.
    pub fn of_profile(&self, profile: Profile) -> CalibrationOptions {
        let [first, ..] = &self.0;
        let options = self.0.iter().find(|options| options.profile == profile);
        *options.unwrap_or(first)
    }
}

impl From<CalibrationOptions> for ByProfile {
    fn from(options: CalibrationOptions) -> ByProfile {
        ByProfile([options; Profile::ALL.len()])
    }
}

fn calibration_from(
    params: &Params,
    semantic: &SemanticOptions,
    profile: Profile,
) -> Result<CalibrationOptions, ParamError> {
    let d = profile.options();
    let meters = 1e-6..=1e4;
    Ok(CalibrationOptions {
        profile: d.profile,
        min_points: params.usize("min_points", d.min_points)?,
        max_points: semantic.max_points,
        registered_points: params.positive("registered_points", d.registered_points)?,
        noise_m: params.f64_in("noise_m", d.noise_m, meters.clone())?,
        region_m: params.f64_in("region_m", d.region_m, 1e-3..=1e4)?,
        scale_sigma: params.f64_in("scale_sigma", d.scale_sigma, 0.0..=0.5)?,
        max_scale_error: params.f64_in("max_scale_error", d.max_scale_error, 0.0..=1.0)?,
        estimate_scale: params.bool("estimate_scale", d.estimate_scale)?,
        trust_axes: params.bool("trust_axes", d.trust_axes)?,
        gravity_sigma_rad: gravity_sigma_rad(params, d.gravity_sigma_rad)?,
        axes: semantic.axes,
        agreement: params.f64_in("agreement", d.agreement, 0.0..=1.0)?,
        start_radius_m: params.f64_in("guess_radius_m", d.start_radius_m, meters.clone())?,
        start_yaw_rad: params.f64_in("guess_yaw_rad", d.start_yaw_rad, 0.0..=3.2)?,
        max_p_wrong: params.f64_in("max_p_wrong", d.max_p_wrong, 1e-12..=0.5)?,
        min_inliers: params.f64_in("min_inliers", d.min_inliers, 0.0..=1.0)?,
        max_contradicted: params.f64_in("max_contradicted", d.max_contradicted, 0.0..=1.0)?,
        max_sigma_m: params.f64_in("max_sigma_m", d.max_sigma_m, meters)?,
        max_sigma_rad: params.f64_in("max_sigma_rad", d.max_sigma_rad, 1e-6..=3.2)?,
    })
}

/// Zero in the parameters stands for an unknown gravity direction.
fn gravity_sigma_rad(params: &Params, default: f64) -> Result<f64, ParamError> {
    let default = if default.is_finite() { default } else { 0.0 };
    let sigma = params.f64_in("gravity_sigma_rad", default, 0.0..=3.2)?;
    Ok(if sigma > 0.0 { sigma } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::registration::SemanticCloud;
    use lattice_runtime::params::ParamValue;
    use nalgebra::Point3;

    /// Points a metre apart on a square around the sensor.
    fn around(half_side: i32) -> [SourceCloud; 1] {
        let sides = -half_side..=half_side;
        let points = sides
            .clone()
            .flat_map(|x| sides.clone().map(move |y| (x, y)));
        let points = points.map(|(x, y)| Point3::new(f64::from(x), f64::from(y), 0.0));
        [SourceCloud {
            cloud: SemanticCloud::unlabelled(points.collect()),
            sensor_m: Some(Point3::origin()),
        }]
    }

    #[test]
    fn each_cloud_has_the_options_of_its_sensor_but_for_what_is_given() {
        let given = [
            ("profile", ParamValue::String("auto".into())),
            ("noise_m", ParamValue::F64(0.07)),
        ];
        let params = Params::from_values("/node", given);
        let all = ServerOptions::from_params(&params).unwrap().calibration;
        let (room, street) = (all.of_clouds(&around(4)), all.of_clouds(&around(40)));
        assert_eq!(
            (room.profile, street.profile),
            (Profile::Headset, Profile::Lidar)
        );
        assert_eq!((room.noise_m, street.noise_m), (0.07, 0.07));
        let usual = Profile::Lidar.options();
        assert_eq!(street.region_m, usual.region_m);
        assert_ne!(room.region_m, usual.region_m);
        assert_eq!(all.of_profile(Profile::Lidar).region_m, usual.region_m);
        // Shown are those of a headset.
        let shown = params.declared();
        assert_eq!(shown.get("region_m"), Some(&ParamValue::F64(room.region_m)));
    }

    #[test]
    fn a_profile_that_is_given_holds_for_all_clouds() {
        let given = [("profile", ParamValue::String("depth_camera".into()))];
        let options = ServerOptions::from_params(&Params::from_values("/node", given)).unwrap();
        let street = options.calibration.of_clouds(&around(40));
        assert_eq!(street.profile, Profile::DepthCamera);
    }
}
