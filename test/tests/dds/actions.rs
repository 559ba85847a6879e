//! An action server of the runtime, asked by an action client of rclpy over Fast DDS.

use std::path::Path;
use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::unique_identifier_msgs::UUID;
use lattice_msgs::{RosAction, RosMessage, RosService, Schema};
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{ActionLimits, GoalHandle, Runtime};
use lattice_test::domain::TestDomain;
use lattice_test::peer;
use lattice_test::python::ros_pythons;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Goals of the client that reach their end.
const GOALS: usize = 100;

/// The order of the goal that is to be canceled.
const ENDLESS: i32 = 1000;

const LIMITS: ActionLimits = ActionLimits {
    max_live: 4,
    max_results: 2 * GOALS,
    max_waiting: 4,
    keep_results: Duration::from_secs(600),
};

/// `test_msgs/action/Fibonacci`, an action of ROS that rclpy has types of.
struct Fibonacci;

macro_rules! messages {
    ($($name:ident $ros_name:literal { $($field:ident: $type:ty),* })*) => {$(
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        struct $name { $($field: $type),* }

        impl RosMessage for $name {
            const SCHEMA: &'static Schema = &Schema {
                type_name: concat!("test_msgs/action/Fibonacci_", $ros_name),
                text: "",
                dependencies: &[],
            };
        }
    )*};
}

messages! {
    Goal "Goal" { order: i32 }
    Sequence "Result" { sequence: Vec<i32> }
    SendGoalRequest "SendGoal_Request" { goal_id: UUID, goal: Goal }
    SendGoalResponse "SendGoal_Response" { accepted: bool, stamp: Time }
    GetResultRequest "GetResult_Request" { goal_id: UUID }
    GetResultResponse "GetResult_Response" { status: i8, result: Sequence }
    FeedbackMessage "FeedbackMessage" { goal_id: UUID, feedback: Sequence }
}

struct SendGoal;

impl RosService for SendGoal {
    const TYPE: &'static str = "test_msgs/action/Fibonacci_SendGoal";
    type Request = SendGoalRequest;
    type Response = SendGoalResponse;
}

struct GetResult;

impl RosService for GetResult {
    const TYPE: &'static str = "test_msgs/action/Fibonacci_GetResult";
    type Request = GetResultRequest;
    type Response = GetResultResponse;
}

impl RosAction for Fibonacci {
    const TYPE: &'static str = "test_msgs/action/Fibonacci";
    type Goal = Goal;
    type Result = Sequence;
    type Feedback = Sequence;
    type SendGoal = SendGoal;
    type GetResult = GetResult;
    type FeedbackMessage = FeedbackMessage;

    fn goal(request: SendGoalRequest) -> (UUID, Goal) {
        (request.goal_id, request.goal)
    }

    fn accepted(accepted: bool, stamp: Time) -> SendGoalResponse {
        SendGoalResponse { accepted, stamp }
    }

    fn wanted(request: &GetResultRequest) -> UUID {
        request.goal_id
    }

    fn result(status: i8, result: Sequence) -> GetResultResponse {
        GetResultResponse { status, result }
    }

    fn feedback(goal_id: UUID, feedback: Sequence) -> FeedbackMessage {
        FeedbackMessage { goal_id, feedback }
    }
}

/// Works a goal off: one number after another, with feedback; an endless one until it is canceled.
fn work(order: i32, goal: GoalHandle<Fibonacci>) {
    goal.execute();
    let feedback = goal.feedback();
    let mut found = Sequence {
        sequence: vec![0, 1],
    };
    while order == ENDLESS || found.sequence.len() < order as usize {
        if goal.is_canceled() {
            return goal.cancel(found);
        }
        if order == ENDLESS {
            // Until the client hears one and cancels.
            std::thread::sleep(Duration::from_millis(5));
        } else {
            let next = found.sequence.iter().rev().take(2).sum();
            found.sequence.push(next);
        }
        feedback.send(found.clone());
    }
    goal.succeed(found);
}

#[test]
fn rclpy_has_goals_reached_rejected_and_canceled() {
    for python in ros_pythons() {
        has_goals_reached_rejected_and_canceled(&python);
    }
}

fn has_goals_reached_rejected_and_canceled(python: &Path) {
    let domain = TestDomain::take();
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("server", args, &domain.transport()).unwrap();
    let (sender, goals) = channel();
    let accept =
        move |goal: Goal, handle| goal.order > 1 && sender.send((goal.order, handle)).is_ok();
    let node = runtime.node("server").unwrap();
    let server = node
        .action_server::<Fibonacci>("/fibonacci", LIMITS, accept, |_| {})
        .unwrap();
    let worker = std::thread::spawn(move || {
        for (order, goal) in goals {
            work(order, goal);
        }
    });
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("scenario.json");
    let scenario = json!({"domain": domain.id(), "goals": GOALS, "endless": ENDLESS});
    std::fs::write(&file, scenario.to_string()).unwrap();
    let found = peer::run(python, "action_peer.py", &[&file]);
    drop(server);
    drop(runtime);
    worker.join().unwrap();

    assert_eq!(found["rejected"], true);
    assert_eq!(found["reached"], GOALS, "{found}");
    let feedback = found["feedback"].as_u64().unwrap();
    assert!(feedback >= GOALS as u64, "{found}");
    // ERROR_NONE, and STATUS_CANCELED with what was found by then.
    assert_eq!(found["canceled"], json!([0, 1, 5, [0, 1]]));
}
