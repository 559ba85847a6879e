//! Actions.

use crate::interface::{RosMessage, RosService};
use crate::packages::builtin_interfaces::Time;
use crate::packages::unique_identifier_msgs::UUID;

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
