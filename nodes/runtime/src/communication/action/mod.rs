//! Action servers: three services and two topics for each, with the names and QoS of ROS.

mod goals;

pub use goals::ActionLimits;
pub(crate) use goals::Goals;

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use lattice_msgs::action_msgs::{GoalStatus, GoalStatusArray};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::unique_identifier_msgs::UUID;
use lattice_msgs::{RosAction, RosService};

use crate::communication::publisher::Publisher;
use crate::communication::service::{Reply, Server};
use crate::sync::lock;

type ResultResponse<A> = <<A as RosAction>::GetResult as RosService>::Response;
type ResultReply<A> = Reply<ResultResponse<A>>;

/// State shared by a server, its handlers and its goals.
pub(crate) struct Shared<A: RosAction> {
    pub name: String,
    pub goals: Mutex<Goals<A, ResultReply<A>>>,
    pub status: Publisher<GoalStatusArray>,
    pub feedback: Publisher<A::FeedbackMessage>,
}

impl<A: RosAction> Shared<A> {
    pub(crate) fn publish_status(&self, goals: &Goals<A, ResultReply<A>>) {
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
    pub(crate) shared: Arc<Shared<A>>,
    pub(crate) _servers: [Server; 3],
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

impl<A: RosAction> Shared<A> {
    /// Gives a new goal to `accept`; false if it is rejected.
    pub(crate) fn take(
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
