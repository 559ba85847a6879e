//! An action server with feedback and a result, and the calls of a client. Actions of one's own implement `RosAction`.
//!
//! `cargo run -p lattice_runtime --example 3_action`

use std::error::Error;
use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_msgs::action_msgs::GoalStatus;
use lattice_msgs::lattice::{
    CalibrateAction, CalibrateFeedback, CalibrateFeedbackMessage, CalibrateGetResult,
    CalibrateGetResultRequest, CalibrateResult, CalibrateSendGoal, CalibrateSendGoalRequest,
};
use lattice_msgs::unique_identifier_msgs::UUID;
use lattice_msgs::{RosService, cdr};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{
    ActionLimits, GoalHandle, LoopbackDomain, Node, Runtime, SubscriptionExecutor,
};

const PATIENCE: Duration = Duration::from_secs(10);
const LIMITS: ActionLimits = ActionLimits {
    max_live: 1,
    max_results: 10,
    max_waiting: 4,
    keep_results: Duration::from_secs(600),
};

/// Works on a goal, here in one step.
fn work(goal: GoalHandle<CalibrateAction>) {
    goal.execute();
    goal.feedback().send(CalibrateFeedback {
        stage: "search".to_owned(),
        fraction: 0.5,
    });
    goal.succeed(CalibrateResult {
        success: true,
        message: "found".to_owned(),
        ..CalibrateResult::default()
    });
}

/// Calls a service and waits for its reply.
fn call<S: RosService>(
    node: &Node,
    name: &str,
    request: &S::Request,
) -> Result<S::Response, Box<dyn Error>> {
    let call = node
        .client::<S>(name)?
        .call(cdr::to_vec(request)?, PATIENCE);
    Ok(cdr::from_slice(&smol::block_on(call)?)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    // A domain of its own on this machine. On a robot: Runtime::start("server", args).
    let domain = LoopbackDomain::take()?;
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env()?
    };
    let args = RosArgs::parse(std::env::args())?;
    let runtime = Runtime::with_transport("server", args, &network)?;

    // The handler hands each goal to this thread and accepts it.
    let (accept, goals) = channel();
    let server = runtime.node("server")?.action_server::<CalibrateAction>(
        "calibrate",
        LIMITS,
        move |_, goal| accept.send(goal).is_ok(),
        |_| println!("a goal is to be canceled"),
    )?;

    let client = runtime.node("client")?;
    let (sender, feedback) = channel();
    let topic = format!("{}/_action/feedback", server.name());
    let shared = SubscriptionExecutor::Shared;
    let _feedback = client.subscribe(&topic, Qos::DEFAULT, shared, move |message| {
        let message: &CalibrateFeedbackMessage = &message;
        // Fails once main has returned.
        let _ = sender.send(message.feedback.clone());
    })?;
    let goal_id = UUID { uuid: [7; 16] };
    let goal = CalibrateSendGoalRequest {
        goal_id,
        ..Default::default()
    };
    let sent = call::<CalibrateSendGoal>(&client, "calibrate/_action/send_goal", &goal)?;
    assert!(sent.accepted);
    work(goals.recv_timeout(PATIENCE)?);
    let feedback = feedback.recv_timeout(PATIENCE)?;
    println!("{}: {} %", feedback.stage, 100.0 * feedback.fraction);
    assert_eq!(feedback.fraction, 0.5);

    let wanted = CalibrateGetResultRequest { goal_id };
    let ended = call::<CalibrateGetResult>(&client, "calibrate/_action/get_result", &wanted)?;
    println!("{} ends: {}", server.name(), ended.result.message);
    assert!(ended.result.success && ended.status == GoalStatus::STATUS_SUCCEEDED);

    runtime.shutdown_handle().request();
    runtime.spin()?;
    Ok(())
}
