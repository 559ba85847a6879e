//! Outputs of the state machine.

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::{CalibrateFeedback, CalibrateResult, CalibrationResult};

use super::search::Job;

/// Request number assigned by the node.
pub type CallId = u64;

/// Outcome of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The headset was localized.
    Found,
    /// It was not, or the request was rejected.
    Failed,
    /// The client canceled the request.
    Canceled,
}

/// Output of the server.
#[derive(Clone, Debug)]
pub enum Output {
    /// For `calibration`.
    Result(Box<CalibrationResult>),
    /// For `/tf`.
    Transform(TransformStamped),
    /// For another thread; its result is passed to [`super::SemanticIcpServer::on_done`].
    Job(Job),
    /// Reply to a request.
    Answer(CallId, End, Box<CalibrateResult>),
    /// Progress of a request.
    Feedback(CallId, CalibrateFeedback),
    /// Map messages were lost: request a keyframe.
    NeedKeyframe,
}

pub(super) fn answer(call: CallId, end: End, result: CalibrationResult) -> Output {
    let answer = CalibrateResult {
        success: end == End::Found,
        message: result.reason.clone(),
        result,
    };
    Output::Answer(call, end, Box::new(answer))
}
