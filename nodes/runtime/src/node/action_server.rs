//! Action servers of a node.

use std::sync::{Arc, Mutex};

use lattice_msgs::RosAction;
use lattice_msgs::action_msgs::CancelGoal;
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::unique_identifier_msgs::UUID;

use super::logical_node::Node;
use crate::communication::action::{ActionLimits, ActionServer, GoalHandle, Goals, Shared};
use crate::config::names::NameKind;
use crate::error::RuntimeError;
use crate::sync::lock;
use crate::transport::qos::Qos;

/// Limit of pending `get_result` requests.
const MAX_WAITING_REQUESTS: usize = 64;

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
