//! Request, options and result of a calibration.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

use super::fit_diagnostics::FitDiagnostics;
use super::margin::Margin;
use super::profile::Profile;
use crate::pose::Axes;
use crate::registration::{Confusion, SemanticCloud};

/// One scan of the headset.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SourceCloud {
    /// Points in the headset's frame: metres, forward, left, up, gravity along -z.
    pub cloud: SemanticCloud,
    /// Place of the headset in the same frame, if it is known.
    pub sensor_m: Option<Point3<f64>>,
}

/// Request for a calibration.
#[derive(Clone, Copy, Debug)]
pub struct CalibrationRequest<'a> {
    /// Scans in one frame; each further one multiplies the likelihood.
    pub source_clouds: &'a [SourceCloud],
    /// `target_from_source` near which the answer is, if something is known.
    pub start: Option<Isometry3<f64>>,
    /// Co-occurrence of labels from earlier calibrations.
    pub confusion: Option<&'a Confusion>,
}

/// Options of a calibration. All lengths are metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CalibrationOptions {
    /// Profile that the others were taken from.
    pub profile: Profile,
    /// Fewest points of the headset.
    pub min_points: usize,
    /// Most points of the headset.
    pub max_points: usize,
    /// Points of the headset that are registered, about; more are thinned.
    pub registered_points: usize,
    /// Standard deviation of the headset's points, and of the place of whole regions of them.
    pub noise_m: f64,
    /// Side of the regions of the headset's cloud that err together.
    pub region_m: f64,
    /// Standard deviation of the headset's scale.
    pub scale_sigma: f64,
    /// Largest difference from 1 of the scale of the headset's points in the map; as a share.
    pub max_scale_error: f64,
    /// True if the headset's points are scaled to the map, whatever their scale.
    pub estimate_scale: bool,
    /// Standard deviation of the tilt between the two frames, radians; infinite if one does not know
    /// where down is.
    pub gravity_sigma_rad: f64,
    /// Axes that the clouds were read as, for what is said of those that were misread.
    pub axes: Axes,
    /// True if axes, handedness and scale are certain: no others are tried, which takes a fifth less time or more.
    pub trust_axes: bool,
    /// Share of places where equal class numbers are expected to agree before anything was learned;
    /// 0 if the label sets have nothing to do with each other.
    pub agreement: f64,
    /// Largest distance of the answer from a given start.
    pub start_radius_m: f64,
    /// Largest difference of its heading from that of a given start, radians.
    pub start_yaw_rad: f64,
    /// Largest probability that another pose is right.
    pub max_p_wrong: f64,
    /// Share of the headset's points that must lie on the map.
    pub min_inliers: f64,
    /// Share of the lines of sight that may contradict the map: they end before one of its surfaces, or go through one.
    pub max_contradicted: f64,
    /// Largest standard deviation of the position in any direction.
    pub max_sigma_m: f64,
    /// Largest standard deviation of the orientation about any axis, radians.
    pub max_sigma_rad: f64,
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
    /// Largest standard deviation along a direction of a kind, metres or radians.
    pub(super) fn max_sigma(&self, kind: DirectionKind) -> f64 {
        match kind {
            DirectionKind::Translation => self.max_sigma_m,
            DirectionKind::Rotation => self.max_sigma_rad,
        }
    }
}

/// Verdict on a calibration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// The pose holds.
    Ok,
    /// Another pose fits nearly as well.
    Ambiguous,
    /// The pose may slide in the weak directions.
    Degenerate,
    /// The headset saw nothing that is on the map.
    NoOverlap,
    /// The input cannot be used.
    RejectedInput,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Verdict; 5] = [
        Verdict::Ok,
        Verdict::Ambiguous,
        Verdict::Degenerate,
        Verdict::NoOverlap,
        Verdict::RejectedInput,
    ];

    /// Name as in `CalibrationResult.msg`.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Ok => "OK",
            Verdict::Ambiguous => "AMBIGUOUS",
            Verdict::Degenerate => "DEGENERATE",
            Verdict::NoOverlap => "NO_OVERLAP",
            Verdict::RejectedInput => "REJECTED_INPUT",
        }
    }
}

/// Kind of a direction: of motion or of turning.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DirectionKind {
    /// Motion; sigma in metres.
    Translation,
    /// Turning; sigma in radians.
    Rotation,
}

/// A direction in which the pose is not held.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WeakDirection {
    /// Unit vector in the map frame.
    pub axis: Vector3<f64>,
    /// Motion or turning.
    pub kind: DirectionKind,
    /// Standard deviation along it, metres or radians.
    pub sigma: f64,
}

/// Agreement of a class of the headset with the map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ClassReliability {
    /// Class of the headset.
    pub source_class: u16,
    /// Share of its observations where the map says the same number.
    pub agreement: f64,
    /// Its observations.
    pub weight: f64,
}

/// Scale of the headset's points: length in the map over that in the headset.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ScaleEstimate {
    /// The scale.
    pub scale: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Log-likelihood by which the cloud fits better with it than as it is.
    pub gain: f64,
}

/// The answer.
#[derive(Clone, PartialEq, Debug)]
pub struct Calibration {
    /// Verdict on it.
    pub verdict: Verdict,
    /// Reason for the verdict, in a sentence.
    pub reason: String,
    /// True if it was ended before it was done.
    pub cancelled: bool,
    /// The best pose that was found; to be used only if the verdict says so.
    pub target_from_source: Isometry3<f64>,
    /// Covariance of x, y, z (m^2) and the turns about x, y, z (rad^2), in the map frame, as in
    /// `geometry_msgs/PoseWithCovariance`.
    pub covariance: Matrix6<f64>,
    /// Scale of the headset's points in the map, None if they do not tell it. The pose is that of points
    /// multiplied by it only with [`CalibrationOptions::estimate_scale`].
    pub scale: Option<ScaleEstimate>,
    /// Margin over the best different pose.
    pub margin: Margin,
    /// Fit of the cloud to the map as such, part by part.
    pub fit: FitDiagnostics,
    /// Log-likelihood by which other axes or another unit of the cloud are ahead after a first look; None if a rough
    /// one was enough.
    pub axis_hypothesis_lead: Option<f64>,
    /// Share of the headset's points on a surface of the map.
    pub inlier_fraction: f64,
    /// Root mean square distance of those from the surfaces, metres.
    pub rmse_m: f64,
    /// Directions in which the pose is not held.
    pub weak_directions: Vec<WeakDirection>,
    /// Agreement of the headset's classes with the map.
    pub class_reliability: Vec<ClassReliability>,
    /// Name of the method that made the winning candidate.
    pub method: &'static str,
    /// Co-occurrence of labels learned here, merged with what was known.
    pub confusion: Confusion,
}

impl Calibration {
    /// An answer without a pose.
    pub fn refused(verdict: Verdict, reason: impl Into<String>) -> Calibration {
        Calibration {
            verdict,
            reason: reason.into(),
            cancelled: false,
            target_from_source: Isometry3::identity(),
            covariance: Matrix6::zeros(),
            scale: None,
            margin: Margin::default(),
            fit: FitDiagnostics::default(),
            axis_hypothesis_lead: None,
            inlier_fraction: 0.0,
            rmse_m: 0.0,
            weak_directions: Vec::new(),
            class_reliability: Vec::new(),
            method: "none",
            confusion: Confusion::default(),
        }
    }
}

/// Reason to end a calibration early.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Refusal {
    /// The input cannot be used, and why.
    Input(String),
    /// Ended from outside.
    Cancelled,
}

impl From<Refusal> for Calibration {
    fn from(refusal: Refusal) -> Calibration {
        match refusal {
            Refusal::Input(reason) => Calibration::refused(Verdict::RejectedInput, reason),
            Refusal::Cancelled => Calibration {
                cancelled: true,
                ..Calibration::refused(Verdict::RejectedInput, "cancelled")
            },
        }
    }
}

/// Parts of a calibration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stage {
    /// The clouds are made ready.
    Prepare,
    /// All places are tried.
    Search,
    /// The best are refined.
    Refine,
    /// One is chosen and judged.
    Judge,
}

/// Hears how far a calibration is, and may end it.
pub trait Progress: Sync {
    /// `fraction` of the whole is done; `Break` ends the calibration.
    fn report(&self, stage: Stage, fraction: f64) -> ControlFlow<()>;
}

/// Hears nothing.
impl Progress for () {
    fn report(&self, _stage: Stage, _fraction: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}
