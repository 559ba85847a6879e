//! Goal states of an action server, without I/O.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use lattice_msgs::RosAction;
use lattice_msgs::action_msgs::{
    CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalStatus, GoalStatusArray,
};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::unique_identifier_msgs::UUID;

/// Goal id reserved for "no goal".
const NO_ID: UUID = UUID { uuid: [0; 16] };

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

/// Reason for rejecting a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// The goal id is zero or in use.
    Id,
    /// The limit of active goals is reached.
    Full,
}

/// A goal from its acceptance until its result expires. `W` identifies a client that waits for the result.
struct Goal<A: RosAction, W> {
    info: GoalInfo,
    /// True after confirmation. Clients see confirmed goals only.
    confirmed: bool,
    status: i8,
    canceled: Arc<AtomicBool>,
    ended: Option<(Instant, A::Result)>,
    waiting: Vec<W>,
}

/// All goals of a server.
pub(crate) struct Goals<A: RosAction, W> {
    limits: ActionLimits,
    goals: BTreeMap<UUID, Goal<A, W>>,
}

/// Status and result of a goal.
pub(super) type Ended<A> = (i8, <A as RosAction>::Result);

impl<A: RosAction, W> Goals<A, W> {
    pub fn new(limits: ActionLimits) -> Self {
        Self {
            limits,
            goals: BTreeMap::new(),
        }
    }

    /// Accepts a goal until it is confirmed or removed; returns its cancellation flag.
    pub(super) fn accept(
        &mut self,
        goal_id: UUID,
        stamp: Time,
    ) -> Result<Arc<AtomicBool>, Refused> {
        if goal_id == NO_ID || self.goals.contains_key(&goal_id) {
            return Err(Refused::Id);
        }
        let live = self.goals.values().filter(|goal| goal.ended.is_none());
        if live.count() >= self.limits.max_live {
            return Err(Refused::Full);
        }
        let canceled = Arc::new(AtomicBool::new(false));
        let goal = Goal {
            info: GoalInfo { goal_id, stamp },
            confirmed: false,
            status: GoalStatus::STATUS_ACCEPTED,
            canceled: Arc::clone(&canceled),
            ended: None,
            waiting: Vec::new(),
        };
        self.goals.insert(goal_id, goal);
        Ok(canceled)
    }

    /// Confirms an accepted goal.
    pub fn confirm(&mut self, goal_id: UUID) {
        if let Some(goal) = self.goals.get_mut(&goal_id) {
            goal.confirmed = true;
        }
    }

    /// Removes an accepted goal that was not confirmed.
    pub fn forget(&mut self, goal_id: UUID) {
        self.goals.remove(&goal_id);
    }

    /// Sets a goal to executing. False: the status did not change.
    pub fn execute(&mut self, goal_id: UUID) -> bool {
        let goal = self.goals.get_mut(&goal_id);
        let waits = |goal: &&mut Goal<A, W>| goal.status == GoalStatus::STATUS_ACCEPTED;
        let Some(goal) = goal.filter(waits) else {
            return false;
        };
        goal.status = GoalStatus::STATUS_EXECUTING;
        true
    }

    /// Ends a goal; returns the clients that wait for its result. Later calls change nothing.
    pub fn end(&mut self, goal_id: UUID, ended: Ended<A>, now: Instant) -> Vec<W> {
        let goal = self.goals.get_mut(&goal_id);
        let Some(goal) = goal.filter(|goal| goal.ended.is_none()) else {
            return Vec::new();
        };
        let (status, result) = ended;
        goal.status = status;
        goal.ended = Some((now, result));
        let waiting = std::mem::take(&mut goal.waiting);
        self.expire(now);
        waiting
    }

    /// Requests cancellation; returns the goals that were not canceling before.
    pub fn cancel(&mut self, request: &CancelGoalRequest) -> (CancelGoalResponse, Vec<UUID>) {
        let GoalInfo { goal_id, stamp } = request.goal_info;
        let all = goal_id == NO_ID && stamp == Time::default();
        let mut response = CancelGoalResponse::default();
        let mut new = Vec::new();
        for (id, goal) in &mut self.goals {
            let early = stamp != Time::default() && goal.info.stamp.to_ns() <= stamp.to_ns();
            if goal.ended.is_none() && (all || early || *id == goal_id) {
                goal.status = GoalStatus::STATUS_CANCELING;
                if !goal.canceled.swap(true, Relaxed) {
                    new.push(*id);
                }
                response.goals_canceling.push(goal.info);
            }
        }
        if response.goals_canceling.is_empty() && goal_id != NO_ID {
            response.return_code = match self.goals.contains_key(&goal_id) {
                true => CancelGoalResponse::ERROR_GOAL_TERMINATED,
                false => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
            };
        }
        (response, new)
    }

    /// Result of a goal, or `None` until it ends. An unknown goal has the status unknown and an empty result.
    pub fn result(&mut self, goal_id: UUID, asks: W) -> Option<(W, Ended<A>)> {
        let unknown = (GoalStatus::STATUS_UNKNOWN, A::Result::default());
        let Some(goal) = self.goals.get_mut(&goal_id) else {
            return Some((asks, unknown));
        };
        if let Some((_, result)) = &goal.ended {
            return Some((asks, (goal.status, result.clone())));
        }
        if goal.waiting.len() >= self.limits.max_waiting {
            return Some((asks, unknown));
        }
        goal.waiting.push(asks);
        None
    }

    /// Status of all goals.
    pub fn status(&self) -> GoalStatusArray {
        let status = |goal: &Goal<A, W>| GoalStatus {
            goal_info: goal.info,
            status: goal.status,
        };
        let confirmed = self.goals.values().filter(|goal| goal.confirmed);
        GoalStatusArray {
            status_list: confirmed.map(status).collect(),
        }
    }

    /// Removes results that are too old or too many. True: at least one was removed.
    pub fn expire(&mut self, now: Instant) -> bool {
        let before = self.goals.len();
        let age = self.limits.keep_results;
        let too_old = |since: Instant| now.saturating_duration_since(since) >= age;
        (self.goals).retain(|_, goal| !goal.ended.as_ref().is_some_and(|(at, _)| too_old(*at)));
        let mut ended: Vec<(Instant, UUID)> = (self.goals.iter())
            .filter_map(|(id, goal)| Some((goal.ended.as_ref()?.0, *id)))
            .collect();
        ended.sort_unstable();
        let surplus = ended.len().saturating_sub(self.limits.max_results);
        for (_, id) in ended.iter().take(surplus) {
            self.goals.remove(id);
        }
        self.goals.len() < before
    }
}

impl Default for ActionLimits {
    fn default() -> Self {
        Self {
            max_live: 8,
            max_results: 32,
            max_waiting: 8,
            // Default of rcl.
            keep_results: Duration::from_secs(15 * 60),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_msgs::lattice::{CalibrateAction, CalibrateResult};

    type Here = Goals<CalibrateAction, &'static str>;

    const LIMITS: ActionLimits = ActionLimits {
        max_live: 2,
        max_results: 2,
        max_waiting: 1,
        keep_results: Duration::from_secs(10),
    };

    fn id(n: u8) -> UUID {
        UUID { uuid: [n; 16] }
    }

    fn at(sec: i32) -> Time {
        Time { sec, nanosec: 0 }
    }

    fn ended(message: &str) -> Ended<CalibrateAction> {
        let result = CalibrateResult {
            message: message.to_owned(),
            ..CalibrateResult::default()
        };
        (GoalStatus::STATUS_SUCCEEDED, result)
    }

    fn accepted(goals: &mut Here, n: u8) -> Arc<AtomicBool> {
        let flag = goals.accept(id(n), at(n.into())).unwrap();
        goals.confirm(id(n));
        flag
    }

    fn statuses(goals: &Here) -> Vec<i8> {
        let list = goals.status().status_list;
        list.iter().map(|goal| goal.status).collect()
    }

    fn cancel(goals: &mut Here, goal_id: UUID, stamp: Time) -> (i8, Vec<UUID>) {
        let goal_info = GoalInfo { goal_id, stamp };
        let (response, _) = goals.cancel(&CancelGoalRequest { goal_info });
        let canceling = response.goals_canceling.iter();
        (
            response.return_code,
            canceling.map(|goal| goal.goal_id).collect(),
        )
    }

    #[test]
    fn a_goal_from_its_acceptance_to_its_result() {
        let mut goals = Here::new(LIMITS);
        let now = Instant::now();
        let canceled = goals.accept(id(1), at(1)).unwrap();
        assert_eq!(goals.accept(id(1), at(2)).unwrap_err(), Refused::Id);
        assert_eq!(goals.accept(NO_ID, at(2)).unwrap_err(), Refused::Id);
        goals.accept(id(2), at(2)).unwrap();
        assert!(statuses(&goals).is_empty(), "not yet confirmed");
        goals.confirm(id(1));
        goals.confirm(id(2));
        assert_eq!(goals.accept(id(3), at(3)).unwrap_err(), Refused::Full);
        assert!(goals.execute(id(1)) && !goals.execute(id(1)) && !goals.execute(id(9)));
        assert_eq!(statuses(&goals), [2, 1]);

        assert_eq!(goals.result(id(1), "first"), None);
        let (asks, (status, _)) = goals.result(id(1), "one too many").unwrap();
        assert_eq!((asks, status), ("one too many", GoalStatus::STATUS_UNKNOWN));
        assert_eq!(goals.end(id(1), ended("done"), now), ["first"]);
        assert!(goals.end(id(1), ended("again"), now).is_empty());
        let (_, (status, result)) = goals.result(id(1), "late").unwrap();
        assert_eq!((status, &*result.message), (4, "done"));
        let (_, (status, result)) = goals.result(id(7), "stranger").unwrap();
        assert_eq!((status, result), (0, CalibrateResult::default()));
        assert!(!canceled.load(Relaxed));
    }

    #[test]
    fn goals_are_canceled_by_name_by_time_or_all() {
        let mut goals = Here::new(ActionLimits {
            max_live: 9,
            ..LIMITS
        });
        let none = Time::default();
        assert_eq!(cancel(&mut goals, NO_ID, none), (0, vec![]));
        assert_eq!(cancel(&mut goals, id(1), none), (2, vec![]));
        let flags: Vec<_> = (1..=5_u8).map(|n| accepted(&mut goals, n)).collect();
        assert_eq!(cancel(&mut goals, id(3), none), (0, vec![id(3)]));
        assert_eq!(cancel(&mut goals, NO_ID, at(1)), (0, vec![id(1)]));
        assert_eq!(cancel(&mut goals, id(4), at(1)), (0, vec![id(1), id(4)]));
        let canceled: Vec<bool> = flags.iter().map(|flag| flag.load(Relaxed)).collect();
        assert_eq!(canceled, [true, false, true, true, false]);
        assert_eq!(statuses(&goals), [3, 1, 3, 3, 1]);
        assert!(!goals.execute(id(3)), "it is canceling");

        goals.end(id(3), ended(""), Instant::now());
        assert_eq!(cancel(&mut goals, id(3), none), (3, vec![]));
        let (response, new) = goals.cancel(&CancelGoalRequest::default());
        assert_eq!(response.goals_canceling.len(), 4);
        assert_eq!(new, [id(2), id(5)], "called only once");
    }

    #[test]
    fn results_are_kept_for_a_time_and_in_bounds() {
        let mut goals = Here::new(LIMITS);
        let start = Instant::now();
        let second = Duration::from_secs(1);
        for n in 1..=3 {
            accepted(&mut goals, n);
            goals.end(id(n), ended(""), start + second * n.into());
        }
        assert_eq!(goals.result(id(1), "w").unwrap().1.0, 0, "the oldest went");
        assert_eq!(goals.result(id(2), "w").unwrap().1.0, 4);
        assert!(!goals.expire(start + second * 11));
        assert!(goals.expire(start + second * 12));
        assert_eq!(statuses(&goals), [4]);
        accepted(&mut goals, 4);
        assert!(goals.expire(start + second * 1000));
        assert_eq!(statuses(&goals), [1], "what is at work stays");
    }
}
