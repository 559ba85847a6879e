//! An action server of the runtime against ros2-client as a client, by both rmw mappings.

use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use futures::StreamExt;
use lattice_msgs::lattice::{CalibrateAction, CalibrateFeedback, CalibrateGoal, CalibrateResult};
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{ActionLimits, GoalHandle, Runtime};
use ros2_client::action::{ActionClientQosPolicies, GoalId};
use ros2_client::action_msgs::{CancelGoalResponseEnum, GoalStatusEnum};
use ros2_client::builtin_interfaces::Time;
use ros2_client::{ActionClient, ActionTypeName, Name, Node, ServiceMapping};

use super::client::{Domain, Foreign, MAPPINGS, PATIENCE, peer, reliable};

const LIMITS: ActionLimits = ActionLimits {
    max_live: 2,
    max_results: 4,
    max_waiting: 4,
    keep_results: PATIENCE,
};

type Client =
    ActionClient<Foreign<CalibrateGoal>, Foreign<CalibrateResult>, Foreign<CalibrateFeedback>>;
type Goals = Receiver<(CalibrateGoal, GoalHandle<CalibrateAction>)>;

fn client(peer: &mut Node, mapping: ServiceMapping) -> Client {
    let policies = ActionClientQosPolicies {
        goal_service: reliable(),
        result_service: reliable(),
        cancel_service: reliable(),
        feedback_subscription: reliable(),
        status_subscription: reliable(),
    };
    let name = Name::parse("/mapper/find").unwrap();
    let type_name = ActionTypeName::new("lattice_msgs", "Calibrate");
    peer.create_action_client(mapping, &name, &type_name, policies)
        .unwrap()
}

fn goal(session: &str) -> Foreign<CalibrateGoal> {
    Foreign(CalibrateGoal {
        session: session.to_owned(),
        ..CalibrateGoal::default()
    })
}

fn result(message: &str) -> CalibrateResult {
    CalibrateResult {
        message: message.to_owned(),
        ..CalibrateResult::default()
    }
}

/// A goal that was accepted, at both ends.
async fn send(client: &Client, goals: &Goals) -> (GoalId, GoalHandle<CalibrateAction>) {
    let (id, response) = client.async_send_goal(goal("a")).await.unwrap();
    assert!(response.accepted);
    let (wanted, handle) = goals.recv_timeout(PATIENCE).unwrap();
    assert_eq!(wanted.session, "a");
    (id, handle)
}

async fn talk(peer: &Node, client: &Client, goals: &Goals) {
    client.goal_client().wait_for_service(peer).await;
    client.cancel_client().wait_for_service(peer).await;
    client.result_client().wait_for_service(peer).await;

    let rejected = async { client.async_send_goal(goal("rejected")).await.unwrap() };
    let (_, response) = rejected.await;
    assert!(!response.accepted);

    // Feedback, until it is heard; then the result, which was asked for before.
    let (id, handle) = send(client, goals).await;
    handle.execute();
    let mut heard = Box::pin(client.feedback_stream(id));
    let feedback = handle.feedback();
    let telling = smol::spawn(async move {
        loop {
            feedback.send(CalibrateFeedback {
                stage: "search".into(),
                fraction: 0.5,
            });
            smol::Timer::after(Duration::from_millis(20)).await;
        }
    });
    let feedback = heard.next().await.unwrap().unwrap();
    assert_eq!((&*feedback.0.stage, feedback.0.fraction), ("search", 0.5));
    drop(telling);
    let ending = smol::spawn(async move {
        smol::Timer::after(Duration::from_millis(100)).await;
        handle.succeed(result("found"));
    });
    let ended = async { client.async_request_result(id).await.unwrap() };
    let (status, found) = ended.await;
    assert_eq!(
        (status, &*found.0.message),
        (GoalStatusEnum::Succeeded, "found")
    );
    ending.await;

    // One is canceled while another goes on, and a third finds no room.
    let (first, canceled) = send(client, goals).await;
    let (second, going_on) = send(client, goals).await;
    let (_, response) = client.async_send_goal(goal("a")).await.unwrap();
    assert!(!response.accepted, "at most {} at work", LIMITS.max_live);
    let cancel = async || client.async_cancel_goal(first, Time::ZERO).await.unwrap();
    let answer = cancel().await;
    assert!(matches!(answer.return_code, CancelGoalResponseEnum::None));
    let ids: Vec<_> = answer.goals_canceling.iter().map(|g| g.goal_id).collect();
    assert!(ids == [first]);
    assert!(canceled.is_canceled() && !going_on.is_canceled());
    canceled.cancel(result("canceled"));
    let (status, _) = client.async_request_result(first).await.unwrap();
    assert_eq!(status, GoalStatusEnum::Canceled);
    let answer = client.async_cancel_goal(first, Time::ZERO).await.unwrap();
    assert!(matches!(
        answer.return_code,
        CancelGoalResponseEnum::GoalTerminated
    ));

    // Dropped without an end: aborted.
    drop(going_on);
    let (status, _) = client.async_request_result(second).await.unwrap();
    assert_eq!(status, GoalStatusEnum::Aborted);
}

#[test]
fn goals_go_their_way_with_clients_of_both_rmw() {
    for &mapping in &MAPPINGS {
        let domain = Domain::take();
        let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
        let runtime = Runtime::with_transport("mapper", args, &domain.network()).unwrap();
        let (sender, goals) = channel();
        let accept = move |goal: CalibrateGoal, handle| {
            let accepted = goal.session == "a";
            if accepted {
                sender.send((goal, handle)).unwrap();
            }
            accepted
        };
        let node = runtime.node("mapper").unwrap();
        let server = node
            .action_server::<CalibrateAction>("~/find", LIMITS, accept, |_| {})
            .unwrap();
        assert_eq!(server.name(), "/mapper/find");
        let mut peer = peer(&domain);
        let client = client(&mut peer, mapping);
        let timeout = async {
            smol::Timer::after(2 * PATIENCE).await;
            panic!("no answer to {mapping:?}");
        };
        smol::block_on(smol::future::or(talk(&peer, &client, &goals), timeout));
    }
}
