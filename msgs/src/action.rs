//! Actions: the services and topics that ROS makes of an `.action` file.

use crate::builtin_interfaces::Time;
use crate::unique_identifier_msgs::UUID;
use crate::{RosMessage, RosService};

/// An action: a goal that takes its time, with feedback meanwhile and a result at the end.
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

    /// Takes a request of `send_goal` apart.
    fn goal(request: <Self::SendGoal as RosService>::Request) -> (UUID, Self::Goal);
    /// Answers it.
    fn accepted(accepted: bool, stamp: Time) -> <Self::SendGoal as RosService>::Response;
    /// The goal that a request of `get_result` is about.
    fn wanted(request: &<Self::GetResult as RosService>::Request) -> UUID;
    /// Answers it; the status is one of `action_msgs/msg/GoalStatus`.
    fn result(status: i8, result: Self::Result) -> <Self::GetResult as RosService>::Response;
    /// Tells how far a goal is.
    fn feedback(goal_id: UUID, feedback: Self::Feedback) -> Self::FeedbackMessage;
}

/// States the actions of a package: the three parts like messages in `messages!`, and the names for
/// the services and the message that ROS makes of them.
macro_rules! actions {
    ($package:literal in $dir:literal; $($action:ident $name:literal:
        $goal:ident [$($goal_dependency:ident),*],
        $result:ident [$($result_dependency:ident),*],
        $feedback:ident [$($feedback_dependency:ident),*];
        with $send_goal:ident: $send_request:ident, $send_response:ident;
        with $get_result:ident: $get_request:ident, $get_response:ident;
        with $feedback_message:ident;)*) => {
        $(
        $crate::action::message! {
            $goal, concat!($package, "/action/", $name, "_Goal"),
            $crate::interface::request_text(include_str!(concat!($dir, $name, ".action"))),
            [$($goal_dependency),*]
        }
        $crate::action::message! {
            $result, concat!($package, "/action/", $name, "_Result"),
            $crate::interface::request_text($crate::interface::response_text(
                include_str!(concat!($dir, $name, ".action")))),
            [$($result_dependency),*]
        }
        $crate::action::message! {
            $feedback, concat!($package, "/action/", $name, "_Feedback"),
            $crate::interface::response_text($crate::interface::response_text(
                include_str!(concat!($dir, $name, ".action")))),
            [$($feedback_dependency),*]
        }

        #[doc = concat!("The service `_action/send_goal` of [`", stringify!($action), "`].")]
        #[derive(Clone, Copy, Debug)]
        pub struct $send_goal;

        #[doc = concat!("Request of [`", stringify!($send_goal), "`].")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $send_request {
            /// Chosen by the client.
            pub goal_id: $crate::unique_identifier_msgs::UUID,
            /// The goal itself.
            pub goal: $goal,
        }

        #[doc = concat!("Response of [`", stringify!($send_goal), "`].")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $send_response {
            /// True if the server takes the goal.
            pub accepted: bool,
            /// Time of the decision.
            pub stamp: $crate::builtin_interfaces::Time,
        }

        #[doc = concat!("The service `_action/get_result` of [`", stringify!($action), "`].")]
        #[derive(Clone, Copy, Debug)]
        pub struct $get_result;

        #[doc = concat!("Request of [`", stringify!($get_result), "`].")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $get_request {
            /// Number of the goal.
            pub goal_id: $crate::unique_identifier_msgs::UUID,
        }

        #[doc = concat!("Response of [`", stringify!($get_result), "`].")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $get_response {
            /// One of `action_msgs/msg/GoalStatus`.
            pub status: i8,
            /// Outcome of the goal.
            pub result: $result,
        }

        #[doc = concat!("The message of `_action/feedback` of [`", stringify!($action), "`].")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $feedback_message {
            /// Number of the goal.
            pub goal_id: $crate::unique_identifier_msgs::UUID,
            /// Progress of a goal.
            pub feedback: $feedback,
        }

        $crate::action::message! {
            $send_request, concat!($package, "/action/", $name, "_SendGoal_Request"),
            concat!("unique_identifier_msgs/UUID goal_id\n", $package, "/", $name, "_Goal goal\n"),
            [$goal, $crate::unique_identifier_msgs::UUID]
        }
        $crate::action::message! {
            $send_response, concat!($package, "/action/", $name, "_SendGoal_Response"),
            "bool accepted\nbuiltin_interfaces/Time stamp\n",
            [$crate::builtin_interfaces::Time]
        }
        $crate::action::message! {
            $get_request, concat!($package, "/action/", $name, "_GetResult_Request"),
            "unique_identifier_msgs/UUID goal_id\n",
            [$crate::unique_identifier_msgs::UUID]
        }
        $crate::action::message! {
            $get_response, concat!($package, "/action/", $name, "_GetResult_Response"),
            concat!("int8 status\n", $package, "/", $name, "_Result result\n"),
            [$result]
        }
        $crate::action::message! {
            $feedback_message, concat!($package, "/action/", $name, "_FeedbackMessage"),
            concat!("unique_identifier_msgs/UUID goal_id\n", $package, "/", $name,
                "_Feedback feedback\n"),
            [$feedback, $crate::unique_identifier_msgs::UUID]
        }

        impl $crate::RosService for $send_goal {
            const TYPE: &'static str = concat!($package, "/action/", $name, "_SendGoal");
            type Request = $send_request;
            type Response = $send_response;
        }

        impl $crate::RosService for $get_result {
            const TYPE: &'static str = concat!($package, "/action/", $name, "_GetResult");
            type Request = $get_request;
            type Response = $get_response;
        }

        impl $crate::RosAction for $action {
            const TYPE: &'static str = concat!($package, "/action/", $name);
            type Goal = $goal;
            type Result = $result;
            type Feedback = $feedback;
            type SendGoal = $send_goal;
            type GetResult = $get_result;
            type FeedbackMessage = $feedback_message;

            fn goal(request: $send_request) -> ($crate::unique_identifier_msgs::UUID, $goal) {
                (request.goal_id, request.goal)
            }

            fn accepted(
                accepted: bool,
                stamp: $crate::builtin_interfaces::Time,
            ) -> $send_response {
                $send_response { accepted, stamp }
            }

            fn wanted(request: &$get_request) -> $crate::unique_identifier_msgs::UUID {
                request.goal_id
            }

            fn result(status: i8, result: $result) -> $get_response {
                $get_response { status, result }
            }

            fn feedback(
                goal_id: $crate::unique_identifier_msgs::UUID,
                feedback: $feedback,
            ) -> $feedback_message {
                $feedback_message { goal_id, feedback }
            }
        })*

        pub(crate) fn visit_actions(visitor: &mut impl $crate::MessageVisitor) {
            $(
                visitor.visit::<$goal>();
                visitor.visit::<$result>();
                visitor.visit::<$feedback>();
                visitor.visit::<$send_request>();
                visitor.visit::<$send_response>();
                visitor.visit::<$get_request>();
                visitor.visit::<$get_response>();
                visitor.visit::<$feedback_message>();
            )*
        }
    };
}

/// States one part of an action.
macro_rules! message {
    ($name:ident, $type_name:expr, $text:expr, [$($dependency:ty),*]) => {
        impl $crate::RosMessage for $name {
            const SCHEMA: &'static $crate::Schema = &$crate::Schema {
                type_name: $type_name,
                text: $text,
                dependencies: &[$(<$dependency as $crate::RosMessage>::SCHEMA),*],
            };
        }
    };
}

pub(crate) use {actions, message};
