//! Result of a global registration.

use nalgebra::{Isometry3, Matrix6, Vector3};

use super::diagnostics::FitDiagnostics;
use super::margin::Margin;
use crate::registration::Confusion;

/// Verdict on the result of a global registration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// The pose is accepted.
    Ok,
    /// The probability that another pose is right exceeds its limit.
    Ambiguous,
    /// The standard deviation along a weak direction exceeds its limit.
    Degenerate,
    /// The source does not overlap the map.
    NoOverlap,
    /// The input is unusable.
    RejectedInput,
}

impl Verdict {
    /// All verdicts.
    pub const ALL: [Verdict; 5] = [
        Verdict::Ok,
        Verdict::Ambiguous,
        Verdict::Degenerate,
        Verdict::NoOverlap,
        Verdict::RejectedInput,
    ];

    /// Name in `CalibrationResult.msg`.
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

/// Kind of a direction of a pose.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DirectionKind {
    /// Translation; sigma in metres.
    Translation,
    /// Rotation; sigma in radians.
    Rotation,
}

/// Weak (degenerate) direction of a pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WeakDirection {
    /// Unit vector in the target frame.
    pub axis: Vector3<f64>,
    /// Translation or rotation.
    pub kind: DirectionKind,
    /// Standard deviation along or about the axis, metres or radians.
    pub sigma: f64,
}

/// Agreement of a source class with the map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ClassReliability {
    /// Class number in the source.
    pub source_class: u16,
    /// Fraction of its observations at which the map has the same class number.
    pub agreement: f64,
    /// Number of its observations.
    pub weight: f64,
}

/// Scale of the source points: length in the map over length in the source.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ScaleEstimate {
    /// Scale factor.
    pub scale: f64,
    /// Standard deviation of the scale.
    pub sigma: f64,
    /// Log-likelihood gained by the scale over scale 1.
    pub gain: f64,
}

/// Result of a global registration.
#[derive(Clone, PartialEq, Debug)]
pub struct Calibration {
    /// Verdict on the pose.
    pub verdict: Verdict,
    /// Reason for the verdict, one sentence.
    pub reason: String,
    /// True if the caller cancelled the registration.
    pub cancelled: bool,
    /// Best pose found; to be used only if the verdict is `OK`.
    pub target_from_source: Isometry3<f64>,
    /// Covariance of x, y, z (m^2) and of the rotations about x, y, z (rad^2) in the target frame, ordered as in
    /// `geometry_msgs/PoseWithCovariance`.
    pub covariance: Matrix6<f64>,
    /// Scale of the source points; `None` if the points do not determine it. The pose refers to scaled points only
    /// with [`CalibrationOptions::estimate_scale`](super::CalibrationOptions::estimate_scale).
    pub scale: Option<ScaleEstimate>,
    /// Margin over the best alternative.
    pub margin: Margin,
    /// Fit of the cloud to the map by region.
    pub fit: FitDiagnostics,
    /// Log-likelihood ratio of the best other axis convention or scale to the declared one; `None` if a rough search
    /// excludes all.
    pub axis_hypothesis_lead: Option<f64>,
    /// Fraction of inliers among the source points.
    pub inlier_fraction: f64,
    /// RMS distance of the inliers from the surfaces, metres.
    pub rmse_m: f64,
    /// Weak directions of the pose.
    pub weak_directions: Vec<WeakDirection>,
    /// Agreement of the source classes with the map.
    pub class_reliability: Vec<ClassReliability>,
    /// Name of the method that found the pose.
    pub method: &'static str,
    /// Label co-occurrence learned by this registration, merged with the prior one.
    pub confusion: Confusion,
}

impl Calibration {
    /// Result without a pose.
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

/// Reason to end a registration early.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Refusal {
    /// Unusable input, with the reason.
    Input(String),
    /// Cancelled by the caller.
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
