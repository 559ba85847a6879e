//! Action servers: three services and two topics for each, with the names and QoS of ROS.

mod goals;

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lattice_msgs::action_msgs::{CancelGoal, GoalStatus, GoalStatusArray};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::unique_identifier_msgs::UUID;
use lattice_msgs::{RosAction, RosService};

use self::goals::Goals;
use super::error::RuntimeError;
use super::names::NameKind;
use super::node::Node;
use super::publisher::Publisher;
use super::qos::Qos;
use super::service::{Reply, Server};
use super::sync::lock;

/// Limit of pending `get_result` requests.
const MAX_WAITING_REQUESTS: usize = 64;

/// Limits of an action server.
#[derive(Clone, Copy, Debug)]
pub struct ActionLimits {
    /// Goals that have not ended; further goals are rejected.
    pub max_live: usize,
    /// Stored results; the oldest are removed.
    pub max_results: usize,
    /// Pending result requests of one goal; further clients receive the status unknown.
    pub max_waiting: usize,
    /// Lifetime of a result.
    pub keep_results: Duration,
}

type ResultResponse<A> = <<A as RosAction>::GetResult as RosService>::Response;
type ResultReply<A> = Reply<ResultResponse<A>>;

struct Shared<A: RosAction> {
    name: String,
    goals: Mutex<Goals<A, ResultReply<A>>>,
    status: Publisher<GoalStatusArray>,
    feedback: Publisher<A::FeedbackMessage>,
}

impl<A: RosAction> Shared<A> {
    fn publish_status(&self, goals: &Goals<A, ResultReply<A>>) {
        // Published under the lock, so that messages keep the order of the states.
        if let Err(error) = self.status.publish(goals.status()) {
            log::debug!("{}: {error}", self.name);
        }
    }

    fn end(&self, goal_id: UUID, status: i8, result: A::Result) {
        let mut goals = lock(&self.goals);
        let waiting = goals.end(goal_id, (status, result.clone()), Instant::now());
        self.publish_status(&goals);
        drop(goals);
        for reply in waiting {
            reply.send(A::result(status, result.clone()));
        }
    }
}

/// An accepted goal. Dropping it without an end aborts it.
pub struct GoalHandle<A: RosAction> {
    shared: Arc<Shared<A>>,
    goal_id: UUID,
    canceled: Arc<AtomicBool>,
    ended: bool,
}

impl<A: RosAction> GoalHandle<A> {
    /// Goal id.
    pub fn id(&self) -> UUID {
        self.goal_id
    }

    /// True after a client has requested cancellation.
    pub fn is_canceled(&self) -> bool {
        self.canceled.load(Relaxed)
    }

    /// Sets the goal's status to executing.
    pub fn execute(&self) {
        let mut goals = lock(&self.shared.goals);
        if goals.execute(self.goal_id) {
            self.shared.publish_status(&goals);
        }
    }

    /// Publisher of the goal's feedback, for any thread.
    pub fn feedback(&self) -> Feedback<A> {
        Feedback {
            publisher: self.shared.feedback.clone(),
            goal_id: self.goal_id,
        }
    }

    /// Ends the goal as succeeded.
    pub fn succeed(self, result: A::Result) {
        self.end(GoalStatus::STATUS_SUCCEEDED, result);
    }

    /// Ends the goal as aborted.
    pub fn abort(self, result: A::Result) {
        self.end(GoalStatus::STATUS_ABORTED, result);
    }

    /// Ends the goal as canceled.
    pub fn cancel(self, result: A::Result) {
        self.end(GoalStatus::STATUS_CANCELED, result);
    }

    fn end(mut self, status: i8, result: A::Result) {
        self.ended = true;
        self.shared.end(self.goal_id, status, result);
    }
}

impl<A: RosAction> Drop for GoalHandle<A> {
    fn drop(&mut self) {
        if !self.ended {
            let aborted = GoalStatus::STATUS_ABORTED;
            self.shared.end(self.goal_id, aborted, A::Result::default());
        }
    }
}

/// Publisher of the feedback of one goal.
pub struct Feedback<A: RosAction> {
    publisher: Publisher<A::FeedbackMessage>,
    goal_id: UUID,
}

impl<A: RosAction> Feedback<A> {
    /// Publishes feedback; drops it if the queue is full.
    pub fn send(&self, feedback: A::Feedback) {
        let message = A::feedback(self.goal_id, feedback);
        if let Err(error) = self.publisher.publish(message) {
            log::debug!("feedback not published: {error}");
        }
    }
}

/// A server of an action; dropping it ends it.
#[must_use = "dropping a server ends it"]
pub struct ActionServer<A: RosAction> {
    shared: Arc<Shared<A>>,
    _servers: [Server; 3],
}

impl<A: RosAction> ActionServer<A> {
    /// Full name of the action.
    pub fn name(&self) -> &str {
        &self.shared.name
    }

    /// Removes expired results; call it regularly.
    pub fn expire(&self) {
        let mut goals = lock(&self.shared.goals);
        if goals.expire(Instant::now()) {
            self.shared.publish_status(&goals);
        }
    }
}

impl Node {
    /// Serves `A`. Both handlers run on the io thread and must return at once.
    ///
    /// `accept` receives each new goal; `false` rejects it.
    /// `canceled` receives each goal whose cancellation is requested. The goal stays active until its handle
    /// ends it.
    pub fn action_server<A: RosAction>(
        &self,
        name: &str,
        limits: ActionLimits,
        mut accept: impl FnMut(A::Goal, GoalHandle<A>) -> bool + Send + 'static,
        mut canceled: impl FnMut(UUID) + Send + 'static,
    ) -> Result<ActionServer<A>, RuntimeError> {
        let clock = self.clock();
        let shared = Arc::new(Shared::<A> {
            name: self.full_name(NameKind::Service, name)?,
            goals: Mutex::new(Goals::new(limits)),
            status: self.publisher(&format!("{name}/_action/status"), Qos::latched(1))?,
            feedback: self.publisher(&format!("{name}/_action/feedback"), Qos::DEFAULT)?,
        });
        let goals = Arc::clone(&shared);
        let send_goal = format!("{name}/_action/send_goal");
        let send_goal = self.service::<A::SendGoal>(&send_goal, move |request| {
            let (goal_id, goal) = A::goal(request);
            let stamp = Time::from_ns(clock.now_ns());
            let accepted = goals.take(goal_id, goal, stamp, &mut accept);
            A::accepted(accepted, stamp)
        })?;
        let goals = Arc::clone(&shared);
        let cancel_goal = format!("{name}/_action/cancel_goal");
        let cancel_goal = self.service::<CancelGoal>(&cancel_goal, move |request| {
            let mut known = lock(&goals.goals);
            let (response, new) = known.cancel(&request);
            if !new.is_empty() {
                goals.publish_status(&known);
            }
            drop(known);
            new.into_iter().for_each(&mut canceled);
            response
        })?;
        let goals = Arc::clone(&shared);
        let get_result = format!("{name}/_action/get_result");
        let get_result = self.service_concurrent::<A::GetResult>(
            &get_result,
            MAX_WAITING_REQUESTS,
            move |request, reply| {
                let answer = lock(&goals.goals).result(A::wanted(&request), reply);
                if let Some((reply, (status, result))) = answer {
                    reply.send(A::result(status, result));
                }
            },
        )?;
        Ok(ActionServer {
            shared,
            _servers: [send_goal, cancel_goal, get_result],
        })
    }
}

impl<A: RosAction> Shared<A> {
    fn take(
        self: &Arc<Self>,
        goal_id: UUID,
        goal: A::Goal,
        stamp: Time,
        accept: &mut impl FnMut(A::Goal, GoalHandle<A>) -> bool,
    ) -> bool {
        let canceled = match lock(&self.goals).accept(goal_id, stamp) {
            Ok(canceled) => canceled,
            Err(why) => {
                log::warn!("{}: goal rejected: {why:?}", self.name);
                return false;
            }
        };
        let handle = GoalHandle {
            shared: Arc::clone(self),
            goal_id,
            canceled,
            ended: false,
        };
        let accepted = accept(goal, handle);
        let mut goals = lock(&self.goals);
        if accepted {
            goals.confirm(goal_id);
            self.publish_status(&goals);
        } else {
            goals.forget(goal_id);
        }
        accepted
    }
}
