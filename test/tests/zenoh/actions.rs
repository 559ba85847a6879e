//! Actions between two sessions: goals, feedback, results, status and cancelation.

use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use lattice_msgs::action_msgs::{CancelGoal, CancelGoalRequest, GoalStatus, GoalStatusArray};
use lattice_msgs::lattice::{
    CalibrateAction, CalibrateFeedback, CalibrateFeedbackMessage, CalibrateGetResult,
    CalibrateGetResultRequest, CalibrateGoal, CalibrateResult, CalibrateSendGoal,
    CalibrateSendGoalRequest,
};
use lattice_msgs::unique_identifier_msgs::UUID;
use lattice_runtime::qos::Qos;
use lattice_runtime::{ActionLimits, GoalHandle};
use lattice_test::python::zenoh_python;

use super::mapping::call;
use super::{PATIENCE, Site, hear};

const LIMITS: ActionLimits = ActionLimits {
    max_live: 4,
    max_results: 10,
    max_waiting: 4,
    keep_results: Duration::from_secs(600),
};

/// Session of the goal that ends only when it is canceled.
const ENDLESS: &str = "endless";

fn id(number: u8) -> UUID {
    UUID { uuid: [number; 16] }
}

fn result(message: &str) -> CalibrateResult {
    CalibrateResult {
        success: true,
        message: message.to_owned(),
        ..CalibrateResult::default()
    }
}

/// Works a goal off, with feedback.
fn work(goal: &CalibrateGoal, handle: GoalHandle<CalibrateAction>) {
    handle.execute();
    let feedback = handle.feedback();
    loop {
        feedback.send(CalibrateFeedback {
            stage: goal.session.clone(),
            fraction: 0.5,
        });
        if goal.session != ENDLESS {
            return handle.succeed(result("reached"));
        }
        if handle.is_canceled() {
            return handle.cancel(result("canceled"));
        }
        // Until the client hears one and cancels.
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn goals_are_reached_rejected_and_canceled() {
    let Some(python) = zenoh_python() else { return };
    let site = Site::start(&python);
    let (ours, theirs) = (site.runtime("server"), site.runtime("client"));
    let (server, client) = (ours.node("server").unwrap(), theirs.node("client").unwrap());
    let (sender, goals) = channel();
    let accept =
        move |goal: CalibrateGoal, handle| !goal.has_guess && sender.send((goal, handle)).is_ok();
    let action = server.action_server::<CalibrateAction>("/calibrate", LIMITS, accept, |_| {});
    let action = action.unwrap();
    let worker = thread::spawn(move || goals.iter().for_each(|(goal, handle)| work(&goal, handle)));
    let (feedback, progress) =
        hear::<CalibrateFeedbackMessage>(&client, "/calibrate/_action/feedback", Qos::DEFAULT);
    let (status, states) =
        hear::<GoalStatusArray>(&client, "/calibrate/_action/status", Qos::LATCHED);
    // Feedback to nobody would be lost: it is not latched.
    while feedback.publisher_count() == 0 || status.publisher_count() == 0 {
        thread::yield_now();
    }
    let send = |number, session: &str, has_guess| {
        let goal = CalibrateGoal {
            has_guess,
            session: session.to_owned(),
            ..CalibrateGoal::default()
        };
        let goal_id = id(number);
        let request = CalibrateSendGoalRequest { goal_id, goal };
        call::<CalibrateSendGoal>(&client, "/calibrate/_action/send_goal", &request).accepted
    };
    let ended = |number| {
        let goal_id = id(number);
        let request = CalibrateGetResultRequest { goal_id };
        let name = "/calibrate/_action/get_result";
        let ended = call::<CalibrateGetResult>(&client, name, &request);
        (ended.status, ended.result.message)
    };
    assert!(!send(1, "refused", true));
    for number in 2..12 {
        assert!(send(number, "short", false));
        assert_eq!(
            ended(number),
            (GoalStatus::STATUS_SUCCEEDED, "reached".to_owned())
        );
    }
    assert!(send(12, ENDLESS, false));
    loop {
        let heard = progress.recv_timeout(PATIENCE).unwrap();
        if heard.goal_id == id(12) {
            assert_eq!(
                (&*heard.feedback.stage, heard.feedback.fraction),
                (ENDLESS, 0.5)
            );
            break;
        }
    }
    let mut request = CancelGoalRequest::default();
    request.goal_info.goal_id = id(12);
    let canceled = call::<CancelGoal>(&client, "/calibrate/_action/cancel_goal", &request);
    assert_eq!(
        (canceled.return_code, canceled.goals_canceling.len()),
        (0, 1)
    );
    assert_eq!(
        ended(12),
        (GoalStatus::STATUS_CANCELED, "canceled".to_owned())
    );
    let is_last = |all: &GoalStatusArray| {
        let last = all
            .status_list
            .iter()
            .find(|one| one.goal_info.goal_id == id(12));
        last.is_some_and(|one| one.status == GoalStatus::STATUS_CANCELED)
    };
    while !is_last(&states.recv_timeout(PATIENCE).unwrap()) {}
    drop(action);
    drop((server, ours));
    worker.join().unwrap();
}
