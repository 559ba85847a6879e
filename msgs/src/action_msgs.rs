//! Messages common to all actions: goals, their states, their cancellation.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::interface::{messages, services};
use crate::unique_identifier_msgs::UUID;

messages! {
    "action_msgs" in "../definitions/action_msgs/";
    GoalInfo [UUID, Time];
    GoalStatus [GoalInfo];
    GoalStatusArray [GoalStatus];
}

services! {
    "action_msgs" in "../definitions/action_msgs/";
    CancelGoal: CancelGoalRequest [GoalInfo], CancelGoalResponse [GoalInfo];
}

/// A goal of an action.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalInfo {
    /// Chosen by the client.
    pub goal_id: UUID,
    /// Time at which the server accepted it.
    pub stamp: Time,
}

/// State of a goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalStatus {
    /// The goal.
    pub goal_info: GoalInfo,
    /// One of the constants.
    pub status: i8,
}

impl GoalStatus {
    /// Unknown.
    pub const STATUS_UNKNOWN: i8 = 0;
    /// Waiting.
    pub const STATUS_ACCEPTED: i8 = 1;
    /// Goal in progress.
    pub const STATUS_EXECUTING: i8 = 2;
    /// Cancellation in progress.
    pub const STATUS_CANCELING: i8 = 3;
    /// Done.
    pub const STATUS_SUCCEEDED: i8 = 4;
    /// Canceled.
    pub const STATUS_CANCELED: i8 = 5;
    /// Aborted by the server.
    pub const STATUS_ABORTED: i8 = 6;
}

/// States of all goals of an action server.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalStatusArray {
    /// Active goals, and recently ended ones.
    pub status_list: Vec<GoalStatus>,
}

/// Cancels goals: the one with the id; all accepted by the stamp, if the id is
/// zero; both where both are given; all, where neither is.
#[derive(Clone, Copy, Debug)]
pub struct CancelGoal;

/// Request of [`CancelGoal`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CancelGoalRequest {
    /// The goal.
    pub goal_info: GoalInfo,
}

/// Response of [`CancelGoal`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CancelGoalResponse {
    /// One of the constants.
    pub return_code: i8,
    /// Goals being canceled.
    pub goals_canceling: Vec<GoalInfo>,
}

impl CancelGoalResponse {
    /// At least one goal is being canceled.
    pub const ERROR_NONE: i8 = 0;
    /// Rejected by the server.
    pub const ERROR_REJECTED: i8 = 1;
    /// Unknown goal.
    pub const ERROR_UNKNOWN_GOAL_ID: i8 = 2;
    /// Already ended.
    pub const ERROR_GOAL_TERMINATED: i8 = 3;
}
