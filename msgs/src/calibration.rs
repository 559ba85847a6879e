//! Calibration of a headset: its pose in the map, and the calls that ask for it.

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

use crate::geometry_msgs::{Pose, Transform, Vector3};
use crate::interface::{messages, services};
use crate::std_msgs::Header;

messages! {
    "lattice_msgs" in "../msg/";
    WeakDirection [Vector3];
    ClassReliability [];
    CalibrationResult [Header, Transform, WeakDirection, ClassReliability];
}

services! {
    "lattice_msgs" in "../srv/";
    Calibrate: CalibrateRequest [Pose], CalibrateResponse [CalibrationResult];
}

/// Pose of a headset in the map, or the reason that there is none.
///
/// Only with the verdict OK is the transform to be used, and only then is it on /tf.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationResult {
    /// Time of the newest cloud used, and frame of the map.
    pub header: Header,
    /// Frame of the headset's clouds, its origin.
    pub child_frame_id: String,
    /// Session of the headset: another session means another origin.
    pub session: String,
    /// One of the constants.
    pub verdict: u8,
    /// The verdict in words.
    pub reason: String,
    /// `map_from_headset_origin`, x forward, y left, z up; the best found if not OK.
    pub transform: Transform,
    /// Covariance of the transform, 6 x 6, row-major: x, y, z (m) and rotations about the fixed axes X, Y, Z of the
    /// map (rad).
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
    /// Log-likelihood above that of the best different pose.
    pub log_margin: f64,
    /// Share of the points that lie on the map.
    pub inlier_fraction: f64,
    /// Root mean square distance of these from the map, m.
    pub rmse_m: f64,
    /// Directions that the clouds leave open.
    pub weak_directions: Vec<WeakDirection>,
    /// Reliability of the labels, by class.
    pub class_reliability: Vec<ClassReliability>,
    /// Method that found the transform.
    pub method: String,
    /// Time it took, s.
    pub duration_s: f64,
    /// Clouds used.
    pub gazes: u32,
    /// Points in these.
    pub points: u64,
}

impl CalibrationResult {
    /// Nothing was calculated: never run, or canceled.
    pub const NONE: u8 = 0;
    /// The headset is where the transform says.
    pub const OK: u8 = 1;
    /// Another place in the map fits about as well.
    pub const AMBIGUOUS: u8 = 2;
    /// The clouds leave a direction open, see `weak_directions`.
    pub const DEGENERATE: u8 = 3;
    /// Nothing in the map fits.
    pub const NO_OVERLAP: u8 = 4;
    /// The clouds or the map cannot be used, see `reason`.
    pub const REJECTED_INPUT: u8 = 5;
}

impl Default for CalibrationResult {
    fn default() -> Self {
        Self {
            header: Header::default(),
            child_frame_id: String::new(),
            session: String::new(),
            verdict: Self::NONE,
            reason: String::new(),
            transform: Transform::default(),
            covariance: [0.0; 36],
            log_margin: 0.0,
            inlier_fraction: 0.0,
            rmse_m: 0.0,
            weak_directions: Vec::new(),
            class_reliability: Vec::new(),
            method: String::new(),
            duration_s: 0.0,
            gazes: 0,
            points: 0,
        }
    }
}

/// A direction that the clouds leave open, or nearly so.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WeakDirection {
    /// Unit vector in the axes of the map.
    pub axis: Vector3,
    /// One of the constants.
    pub kind: u8,
    /// Standard deviation.
    pub sigma: f64,
}

impl WeakDirection {
    /// Along the axis, sigma in m.
    pub const TRANSLATION: u8 = 0;
    /// About the axis, sigma in rad.
    pub const ROTATION: u8 = 1;
}

/// Reliability of the labels of one class of the headset.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClassReliability {
    /// Number of the class in the headset.
    pub class_id: u16,
    /// Share of its points on the map that have the same class there, 0 to 1.
    pub agreement: f64,
    /// Approximate number of points behind it.
    pub weight: f64,
}

/// Finds the headset in the map by the clouds it has sent.
#[derive(Clone, Copy, Debug)]
pub struct Calibrate;

/// Request of [`Calibrate`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateRequest {
    /// False: search the whole map.
    pub has_guess: bool,
    /// Approximate `map_from_headset_origin`.
    pub guess: Pose,
    /// Refused unless the headset's; empty: whichever it is.
    pub session: String,
}

/// Response of [`Calibrate`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateResponse {
    /// True: the verdict is OK.
    pub success: bool,
    /// Explanation of the outcome.
    pub message: String,
    /// The calibration.
    pub result: CalibrationResult,
}

/// Finds the headset in the map by the clouds it has sent; ends early when canceled.
#[derive(Clone, Copy, Debug)]
pub struct CalibrateAction;

/// Goal of [`CalibrateAction`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateGoal {
    /// False: search the whole map.
    pub has_guess: bool,
    /// Approximate `map_from_headset_origin`.
    pub guess: Pose,
    /// Refused unless the headset's; empty: whichever it is.
    pub session: String,
}

/// Result of [`CalibrateAction`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateResult {
    /// True: the verdict is OK.
    pub success: bool,
    /// Explanation of the outcome.
    pub message: String,
    /// The calibration.
    pub result: CalibrationResult,
}

/// Feedback of [`CalibrateAction`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateFeedback {
    /// Step at work.
    pub stage: String,
    /// Share of the whole that is done, 0 to 1.
    pub fraction: f32,
}
