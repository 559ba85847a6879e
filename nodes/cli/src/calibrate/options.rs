//! Search options of `lattice calibrate`: the profile and its overrides.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use lattice_core::pose::Axes;
use lattice_core::registration::{CalibrationOptions, Profile, SourceCloud};

/// Sensor and thresholds, by default of the profile.
#[derive(Args)]
#[command(next_help_heading = "Search and verdict [default: of the profile]")]
pub struct SearchOptions {
    /// Sensor of the cloud, which sets the defaults of the others
    #[arg(long, alias = "from", value_parser = profile(), default_value = AUTO)]
    profile: Sensor,
    /// Standard deviation of the cloud's points, m
    #[arg(long)]
    noise: Option<f64>,
    /// Size of regions of the cloud with correlated errors, m
    #[arg(long)]
    region: Option<f64>,
    /// Standard deviation of the cloud's scale
    #[arg(long)]
    scale_sigma: Option<f64>,
    /// Standard deviation of the tilt between cloud and map, rad; 0: the gravity direction of one of them is unknown
    #[arg(long)]
    gravity_sigma: Option<f64>,
    /// Prior fraction of places where equal class numbers agree
    #[arg(long)]
    agreement: Option<f64>,
    /// Largest distance of the result from a guess, m
    #[arg(long)]
    guess_radius: Option<f64>,
    /// Largest heading difference of the result from a guess, rad
    #[arg(long)]
    guess_yaw: Option<f64>,
    /// Smallest number of points of a cloud
    #[arg(long)]
    min_points: Option<usize>,
    /// Approximate number of registered points; larger clouds are thinned
    #[arg(long)]
    registered_points: Option<usize>,
    /// Largest probability of error for the verdict OK
    #[arg(long)]
    max_p_wrong: Option<f64>,
    /// Smallest inlier fraction for OK
    #[arg(long)]
    min_inliers: Option<f64>,
    /// Largest fraction of contradicted lines of sight for OK: those that end before a surface of the map, or pass through one
    #[arg(long)]
    max_contradicted: Option<f64>,
    /// Largest standard deviation of the position in its weakest direction for OK, m
    #[arg(long)]
    max_sigma: Option<f64>,
    /// Largest standard deviation of a rotation about any axis for OK, rad
    #[arg(long)]
    max_sigma_rad: Option<f64>,
    /// Largest deviation of the cloud's scale from 1 for OK
    #[arg(long)]
    max_scale_error: Option<f64>,
    /// Scale the cloud to the map, for any scale; the pose is that of the scaled cloud
    #[arg(long)]
    estimate_scale: bool,
    /// Test no other axis conventions and scales of the cloud: these are certain; saves a fifth of the time or more
    #[arg(long)]
    trust_axes: bool,
}

/// Requested profile; `None`: detected from the cloud.
#[derive(Clone, Copy)]
struct Sensor(Option<Profile>);

const AUTO: &str = "auto";

fn profile() -> impl TypedValueParser<Value = Sensor> {
    let help = |profile| match profile {
        Profile::Headset => "The mesh of a mixed-reality headset, upright",
        Profile::Lidar => "A laser scanner that may lean",
        Profile::DepthCamera => "A depth camera with an IMU",
    };
    let auto = PossibleValue::new(AUTO).help("Detected from range, density and noise");
    let value = |profile: Profile| PossibleValue::new(profile.name()).help(help(profile));
    let values = std::iter::once(auto).chain(Profile::ALL.map(value));
    let named = |name: &str| Profile::ALL.into_iter().find(|p| p.name() == name);
    PossibleValuesParser::new(values.collect::<Vec<_>>())
        .map(move |name: String| Sensor(named(&name)))
}

/// Checks that a number is within its bounds; the default if none is given.
fn within(
    name: &str,
    value: Option<f64>,
    default: f64,
    (least, most): (f64, f64),
) -> Result<f64, String> {
    match value {
        Some(value) if !(least..=most).contains(&value) => {
            Err(format!("--{name} {value} is outside {least} to {most}"))
        }
        _ => Ok(value.unwrap_or(default)),
    }
}

impl SearchOptions {
    /// True if the pose is that of the scaled cloud.
    pub fn scales(&self) -> bool {
        self.estimate_scale
    }

    /// Options of a calibration of clouds read with the axes `axes`.
    ///
    /// # Errors
    /// If a number is out of bounds.
    pub fn options(
        &self,
        axes: Axes,
        max_points: usize,
        headset_scans: &[SourceCloud],
    ) -> Result<CalibrationOptions, String> {
        let Sensor(asked) = self.profile;
        let profile = asked.unwrap_or_else(|| Profile::of(headset_scans));
        let usual = profile.options();
        let (share, length, angle) = ((0.0, 1.0), (1e-6, 1e4), (0.0, 3.2));
        let gravity = self.gravity_sigma.map(|sigma| match sigma {
            0.0 => Ok(f64::INFINITY),
            _ => within("gravity-sigma", Some(sigma), 0.0, angle),
        });
        let radius_m = usual.start_radius_m;
        Ok(CalibrationOptions {
            min_points: self.min_points.unwrap_or(usual.min_points),
            max_points,
            registered_points: (self.registered_points)
                .unwrap_or(usual.registered_points)
                .max(1),
            noise_m: within("noise", self.noise, usual.noise_m, length)?,
            region_m: within("region", self.region, usual.region_m, (1e-3, 1e4))?,
            scale_sigma: within(
                "scale-sigma",
                self.scale_sigma,
                usual.scale_sigma,
                (0.0, 0.5),
            )?,
            max_scale_error: within(
                "max-scale-error",
                self.max_scale_error,
                usual.max_scale_error,
                share,
            )?,
            estimate_scale: self.estimate_scale,
            gravity_sigma_rad: gravity.unwrap_or(Ok(usual.gravity_sigma_rad))?,
            axes,
            trust_axes: self.trust_axes,
            agreement: within("agreement", self.agreement, usual.agreement, share)?,
            start_radius_m: within("guess-radius", self.guess_radius, radius_m, length)?,
            start_yaw_rad: within("guess-yaw", self.guess_yaw, usual.start_yaw_rad, angle)?,
            max_p_wrong: within(
                "max-p-wrong",
                self.max_p_wrong,
                usual.max_p_wrong,
                (1e-12, 0.5),
            )?,
            min_inliers: within("min-inliers", self.min_inliers, usual.min_inliers, share)?,
            max_contradicted: within(
                "max-contradicted",
                self.max_contradicted,
                usual.max_contradicted,
                share,
            )?,
            max_sigma_m: within("max-sigma", self.max_sigma, usual.max_sigma_m, length)?,
            max_sigma_rad: within(
                "max-sigma-rad",
                self.max_sigma_rad,
                usual.max_sigma_rad,
                (1e-6, 3.2),
            )?,
            ..usual
        })
    }
}
