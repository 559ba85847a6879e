//! Services and topics that ROS derives from `Calibrate.action`.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::calibration::{
    CalibrateAction, CalibrateFeedback, CalibrateGoal, CalibrateResult, CalibrationResult,
};
use crate::geometry_msgs::Pose;
use crate::interface::{request_text, response_text};
use crate::unique_identifier_msgs::UUID;
use crate::{MessageVisitor, RosMessage, RosService, Schema};

/// An action: a long-running goal with feedback and a result.
pub trait RosAction: Send + 'static {
    /// Type name, such as `lattice_msgs/action/Calibrate`.
    const TYPE: &'static str;
    /// Goal of a client.
    type Goal: RosMessage;
    /// Outcome of a goal.
    type Result: RosMessage;
    /// Progress of a goal.
    type Feedback: RosMessage;
    /// The service `_action/send_goal`.
    type SendGoal: RosService + 'static;
    /// The service `_action/get_result`.
    type GetResult: RosService + 'static;
    /// The message of `_action/feedback`.
    type FeedbackMessage: RosMessage;

    /// Splits a request of `send_goal`.
    fn goal(request: <Self::SendGoal as RosService>::Request) -> (UUID, Self::Goal);
    /// Response of `send_goal`.
    fn accepted(accepted: bool, stamp: Time) -> <Self::SendGoal as RosService>::Response;
    /// Goal id in a request of `get_result`.
    fn wanted(request: &<Self::GetResult as RosService>::Request) -> UUID;
    /// Response of `get_result`; the status is one of `action_msgs/msg/GoalStatus`.
    fn result(status: i8, result: Self::Result) -> <Self::GetResult as RosService>::Response;
    /// Feedback message of a goal.
    fn feedback(goal_id: UUID, feedback: Self::Feedback) -> Self::FeedbackMessage;
}

/// The service `_action/send_goal` of [`CalibrateAction`].
#[derive(Clone, Copy, Debug)]
pub struct CalibrateSendGoal;

/// Request of [`CalibrateSendGoal`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateSendGoalRequest {
    /// Goal id, chosen by the client.
    pub goal_id: UUID,
    /// Goal itself.
    pub goal: CalibrateGoal,
}

/// Response of [`CalibrateSendGoal`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateSendGoalResponse {
    /// True if the server accepts the goal.
    pub accepted: bool,
    /// Time of the decision.
    pub stamp: Time,
}

/// The service `_action/get_result` of [`CalibrateAction`].
#[derive(Clone, Copy, Debug)]
pub struct CalibrateGetResult;

/// Request of [`CalibrateGetResult`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateGetResultRequest {
    /// Id of the goal.
    pub goal_id: UUID,
}

/// Response of [`CalibrateGetResult`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateGetResultResponse {
    /// Status of the goal, one of `action_msgs/msg/GoalStatus`.
    pub status: i8,
    /// Outcome of the goal.
    pub result: CalibrateResult,
}

/// The message of `_action/feedback` of [`CalibrateAction`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrateFeedbackMessage {
    /// Id of the goal.
    pub goal_id: UUID,
    /// Progress of the goal.
    pub feedback: CalibrateFeedback,
}

const TEXT: &str = include_str!("../action/Calibrate.action");

/// Declares parts of the action: the name after `Calibrate_`, the text, and the messages
/// that the fields refer to.
macro_rules! parts {
    ($($part:ident $name:literal $text:expr, [$($dependency:ty),*];)*) => {
        $(impl RosMessage for $part {
            const SCHEMA: &'static Schema = &Schema {
                type_name: concat!("lattice_msgs/action/Calibrate_", $name),
                text: $text,
                dependencies: &[$(<$dependency as RosMessage>::SCHEMA),*],
            };
        })*

        pub(crate) fn visit_parts(visitor: &mut impl MessageVisitor) {
            $(visitor.visit::<$part>();)*
        }
    };
}

parts! {
    CalibrateGoal "Goal" request_text(TEXT), [Pose];
    CalibrateResult "Result" request_text(response_text(TEXT)), [CalibrationResult];
    CalibrateFeedback "Feedback" response_text(response_text(TEXT)), [];
    CalibrateSendGoalRequest "SendGoal_Request"
        "unique_identifier_msgs/UUID goal_id\nlattice_msgs/Calibrate_Goal goal\n",
        [CalibrateGoal, UUID];
    CalibrateSendGoalResponse "SendGoal_Response"
        "bool accepted\nbuiltin_interfaces/Time stamp\n", [Time];
    CalibrateGetResultRequest "GetResult_Request"
        "unique_identifier_msgs/UUID goal_id\n", [UUID];
    CalibrateGetResultResponse "GetResult_Response"
        "int8 status\nlattice_msgs/Calibrate_Result result\n", [CalibrateResult];
    CalibrateFeedbackMessage "FeedbackMessage"
        "unique_identifier_msgs/UUID goal_id\nlattice_msgs/Calibrate_Feedback feedback\n",
        [CalibrateFeedback, UUID];
}

impl RosService for CalibrateSendGoal {
    const TYPE: &'static str = "lattice_msgs/action/Calibrate_SendGoal";
    type Request = CalibrateSendGoalRequest;
    type Response = CalibrateSendGoalResponse;
}

impl RosService for CalibrateGetResult {
    const TYPE: &'static str = "lattice_msgs/action/Calibrate_GetResult";
    type Request = CalibrateGetResultRequest;
    type Response = CalibrateGetResultResponse;
}

impl RosAction for CalibrateAction {
    const TYPE: &'static str = "lattice_msgs/action/Calibrate";
    type Goal = CalibrateGoal;
    type Result = CalibrateResult;
    type Feedback = CalibrateFeedback;
    type SendGoal = CalibrateSendGoal;
    type GetResult = CalibrateGetResult;
    type FeedbackMessage = CalibrateFeedbackMessage;

    fn goal(request: CalibrateSendGoalRequest) -> (UUID, CalibrateGoal) {
        (request.goal_id, request.goal)
    }

    fn accepted(accepted: bool, stamp: Time) -> CalibrateSendGoalResponse {
        CalibrateSendGoalResponse { accepted, stamp }
    }

    fn wanted(request: &CalibrateGetResultRequest) -> UUID {
        request.goal_id
    }

    fn result(status: i8, result: CalibrateResult) -> CalibrateGetResultResponse {
        CalibrateGetResultResponse { status, result }
    }

    fn feedback(goal_id: UUID, feedback: CalibrateFeedback) -> CalibrateFeedbackMessage {
        CalibrateFeedbackMessage { goal_id, feedback }
    }
}
