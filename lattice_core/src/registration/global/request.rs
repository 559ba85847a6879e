//! Request and options of a global registration, and its progress.

use std::ops::ControlFlow;

use nalgebra::Isometry3;

use super::calibration::DirectionKind;
use super::profile::Profile;
pub use super::source_cloud::SourceCloud;
use crate::pose::Axes;
use crate::registration::Confusion;

/// Input of [`register_global`](super::register_global).
#[derive(Clone, Copy, Debug)]
pub struct CalibrationRequest<'a> {
    /// Clouds in one source frame, registered together.
    pub source_clouds: &'a [SourceCloud],
    /// Initial guess of `target_from_source`, if there is one.
    pub start: Option<Isometry3<f64>>,
    /// Label co-occurrence learned by earlier registrations.
    pub confusion: Option<&'a Confusion>,
}

/// Options of a global registration. All lengths are metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CalibrationOptions {
    /// Sensor profile that the defaults come from.
    pub profile: Profile,
    /// Minimum number of source points.
    pub min_points: usize,
    /// Maximum number of source points.
    pub max_points: usize,
    /// Target number of registered points; larger clouds are downsampled.
    pub registered_points: usize,
    /// Standard deviation of the points, and of the position error that a region has in common.
    pub noise_m: f64,
    /// Side of the regions within which errors are correlated.
    pub region_m: f64,
    /// Standard deviation of the source scale.
    pub scale_sigma: f64,
    /// Largest accepted difference of the source scale from 1, as a fraction.
    pub max_scale_error: f64,
    /// Scales the source points to the map, whatever their scale.
    pub estimate_scale: bool,
    /// Standard deviation of the tilt between the two frames, radians; `INFINITY` if the gravity direction is
    /// unknown.
    pub gravity_sigma_rad: f64,
    /// Axis convention that the clouds are declared as, named in reasons.
    pub axes: Axes,
    /// Skips the test of other axis conventions and scales, which takes a fifth of the time or more.
    pub trust_axes: bool,
    /// Prior fraction of correspondences with equal class numbers; 0 if the label sets are unrelated.
    pub agreement: f64,
    /// Largest distance of the result from the initial guess.
    pub start_radius_m: f64,
    /// Largest difference of its heading from that of the initial guess, radians.
    pub start_yaw_rad: f64,
    /// Largest accepted probability of error, p_wrong.
    pub max_p_wrong: f64,
    /// Minimum fraction of inliers.
    pub min_inliers: f64,
    /// Largest fraction of lines of sight that contradict the map: they end in its free space or pass through a
    /// surface.
    pub max_contradicted: f64,
    /// Largest accepted standard deviation of the position in any direction.
    pub max_sigma_m: f64,
    /// Largest accepted standard deviation of the orientation about any axis, radians.
    pub max_sigma_rad: f64,
}

impl Profile {
    /// Default options of the profile.
    pub fn options(self) -> CalibrationOptions {
        let profile = self;
        let headset = CalibrationOptions::default();
        match self {
            Profile::Headset => headset,
            Profile::Lidar => CalibrationOptions {
                profile,
                noise_m: 0.03,
                region_m: 4.0,
                scale_sigma: 0.0,
                gravity_sigma_rad: f64::INFINITY,
                start_radius_m: 30.0,
                // Correct poses of scans 30 m apart have at least 0.28; wrong ones lack the margin.
                min_inliers: 0.2,
                max_sigma_m: 0.15,
                ..headset
            },
            Profile::DepthCamera => CalibrationOptions {
                profile,
                noise_m: 0.03,
                region_m: 0.5,
                scale_sigma: 0.01,
                gravity_sigma_rad: 0.02,
                ..headset
            },
        }
    }
}

impl Default for CalibrationOptions {
    fn default() -> CalibrationOptions {
        CalibrationOptions {
            profile: Profile::Headset,
            min_points: 100,
            max_points: 500_000,
            registered_points: 4_000,
            noise_m: 0.02,
            region_m: 1.0,
            scale_sigma: 0.005,
            max_scale_error: 0.03,
            estimate_scale: false,
            gravity_sigma_rad: 0.006,
            axes: Axes::RosFlu,
            trust_axes: false,
            agreement: 0.6,
            start_radius_m: 2.0,
            start_yaw_rad: 1.0,
            max_p_wrong: 0.01,
            min_inliers: 0.4,
            max_contradicted: 0.3,
            max_sigma_m: 0.1,
            max_sigma_rad: 0.04,
        }
    }
}

impl CalibrationOptions {
    /// Largest accepted standard deviation of a kind of direction, metres or radians.
    pub(super) fn max_sigma(&self, kind: DirectionKind) -> f64 {
        match kind {
            DirectionKind::Translation => self.max_sigma_m,
            DirectionKind::Rotation => self.max_sigma_rad,
        }
    }
}

/// Stage of a global registration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stage {
    /// Preparation of the clouds.
    Prepare,
    /// Search over all poses.
    Search,
    /// Refinement of the best hypotheses.
    Refine,
    /// Selection of a candidate and its verdict.
    Judge,
}

/// Receiver of progress reports, which may cancel the registration.
pub trait Progress: Sync {
    /// Reports that `fraction` of the work is done; `Break` cancels the registration.
    fn report(&self, stage: Stage, fraction: f64) -> ControlFlow<()>;
}

/// Ignores progress.
impl Progress for () {
    fn report(&self, _stage: Stage, _fraction: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}
