//! Lifecycle state machine with the ids and labels of `rcl_lifecycle` in ROS 2 Jazzy.

use lattice_msgs::lifecycle_msgs::{State, Transition, TransitionDescription};

const UNCONFIGURED: u8 = State::PRIMARY_STATE_UNCONFIGURED;
const INACTIVE: u8 = State::PRIMARY_STATE_INACTIVE;
const ACTIVE: u8 = State::PRIMARY_STATE_ACTIVE;
const FINALIZED: u8 = State::PRIMARY_STATE_FINALIZED;
const CONFIGURING: u8 = State::TRANSITION_STATE_CONFIGURING;
const CLEANING_UP: u8 = State::TRANSITION_STATE_CLEANINGUP;
const SHUTTING_DOWN: u8 = State::TRANSITION_STATE_SHUTTINGDOWN;
const ACTIVATING: u8 = State::TRANSITION_STATE_ACTIVATING;
const DEACTIVATING: u8 = State::TRANSITION_STATE_DEACTIVATING;
const PROCESSING_ERROR: u8 = State::TRANSITION_STATE_ERRORPROCESSING;

/// States in the order of ROS.
const STATES: [(u8, &str); 11] = [
    (State::PRIMARY_STATE_UNKNOWN, "unknown"),
    (UNCONFIGURED, "unconfigured"),
    (INACTIVE, "inactive"),
    (ACTIVE, "active"),
    (FINALIZED, "finalized"),
    (CONFIGURING, "configuring"),
    (CLEANING_UP, "cleaningup"),
    (SHUTTING_DOWN, "shuttingdown"),
    (ACTIVATING, "activating"),
    (DEACTIVATING, "deactivating"),
    (PROCESSING_ERROR, "errorprocessing"),
];

const SUCCESS: &str = "transition_success";
const FAILURE: &str = "transition_failure";
const ERROR: &str = "transition_error";

/// A transition: id, label, source state and target state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    id: u8,
    label: &'static str,
    start: u8,
    goal: u8,
}

const fn edge(id: u8, label: &'static str, start: u8, goal: u8) -> Edge {
    Edge {
        id,
        label,
        start,
        goal,
    }
}

/// Transitions in the order of ROS.
const EDGES: [Edge; 25] = [
    edge(1, "configure", UNCONFIGURED, CONFIGURING),
    edge(10, SUCCESS, CONFIGURING, INACTIVE),
    edge(11, FAILURE, CONFIGURING, UNCONFIGURED),
    edge(12, ERROR, CONFIGURING, PROCESSING_ERROR),
    edge(2, "cleanup", INACTIVE, CLEANING_UP),
    edge(20, SUCCESS, CLEANING_UP, UNCONFIGURED),
    edge(21, FAILURE, CLEANING_UP, INACTIVE),
    edge(22, ERROR, CLEANING_UP, PROCESSING_ERROR),
    edge(3, "activate", INACTIVE, ACTIVATING),
    edge(30, SUCCESS, ACTIVATING, ACTIVE),
    edge(31, FAILURE, ACTIVATING, INACTIVE),
    edge(32, ERROR, ACTIVATING, PROCESSING_ERROR),
    edge(4, "deactivate", ACTIVE, DEACTIVATING),
    edge(40, SUCCESS, DEACTIVATING, INACTIVE),
    edge(41, FAILURE, DEACTIVATING, ACTIVE),
    edge(42, ERROR, DEACTIVATING, PROCESSING_ERROR),
    edge(5, "shutdown", UNCONFIGURED, SHUTTING_DOWN),
    edge(6, "shutdown", INACTIVE, SHUTTING_DOWN),
    edge(7, "shutdown", ACTIVE, SHUTTING_DOWN),
    edge(50, SUCCESS, SHUTTING_DOWN, FINALIZED),
    edge(51, FAILURE, SHUTTING_DOWN, FINALIZED),
    edge(52, ERROR, SHUTTING_DOWN, PROCESSING_ERROR),
    edge(60, SUCCESS, PROCESSING_ERROR, UNCONFIGURED),
    edge(61, FAILURE, PROCESSING_ERROR, FINALIZED),
    edge(62, ERROR, PROCESSING_ERROR, FINALIZED),
];

/// Transition callback of a managed node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Acquire resources: endpoints, threads, memory.
    Configure,
    /// Release resources.
    Cleanup,
    /// Start to receive and publish.
    Activate,
    /// Stop to receive and publish.
    Deactivate,
    /// Release all resources finally.
    Shutdown,
}

impl Edge {
    /// Callback of this transition; `None` for a transition that ends another.
    pub(super) fn step(self) -> Option<Step> {
        match self.goal {
            CONFIGURING => Some(Step::Configure),
            CLEANING_UP => Some(Step::Cleanup),
            ACTIVATING => Some(Step::Activate),
            DEACTIVATING => Some(Step::Deactivate),
            SHUTTING_DOWN => Some(Step::Shutdown),
            _ => None,
        }
    }

    /// Transition message.
    pub(super) fn message(self) -> TransitionDescription {
        TransitionDescription {
            transition: Transition {
                id: self.id,
                label: self.label.to_owned(),
            },
            start_state: state_message(self.start),
            goal_state: state_message(self.goal),
        }
    }
}

fn state_message(id: u8) -> State {
    let known = STATES.iter().find(|(state, _)| *state == id);
    State {
        id,
        label: known.map_or("unknown", |(_, label)| label).to_owned(),
    }
}

/// Lifecycle state of a node.
#[derive(Debug)]
pub(super) struct Machine(u8);

impl Machine {
    pub(super) fn new() -> Self {
        Self(UNCONFIGURED)
    }

    /// Current state as a message.
    pub(super) fn state(&self) -> State {
        state_message(self.0)
    }

    /// Transitions available in the current state.
    pub(super) fn available(&self) -> impl Iterator<Item = Edge> {
        let state = self.0;
        EDGES.into_iter().filter(move |edge| edge.start == state)
    }

    /// Begins the requested transition, selected by its label if given, else by its id.
    /// `None`: the current state has no such transition.
    pub(super) fn begin(&mut self, wanted: &Transition) -> Option<Edge> {
        let is_wanted = |edge: &Edge| match wanted.label.as_str() {
            "" => edge.id == wanted.id,
            label => edge.label == label,
        };
        // Requests cannot end a transition in progress.
        let found = self
            .available()
            .find(|edge| is_wanted(edge) && edge.step().is_some())?;
        self.0 = found.goal;
        Some(found)
    }

    /// Ends the transition in progress.
    pub(super) fn end(&mut self, succeeded: bool) -> Option<Edge> {
        let label = if succeeded { SUCCESS } else { FAILURE };
        let found = self.available().find(|edge| edge.label == label)?;
        self.0 = found.goal;
        Some(found)
    }
}

/// All states, as messages.
pub(super) fn states() -> Vec<State> {
    STATES.iter().map(|(id, _)| state_message(*id)).collect()
}

/// All transitions, as messages.
pub(super) fn graph() -> Vec<TransitionDescription> {
    EDGES.iter().map(|edge| edge.message()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by_label(label: &str) -> Transition {
        Transition {
            id: 0,
            label: label.to_owned(),
        }
    }

    fn by_id(id: u8) -> Transition {
        Transition {
            id,
            label: String::new(),
        }
    }

    #[test]
    fn a_node_goes_through_its_states() {
        let mut machine = Machine::new();
        for (wanted, step, after) in [
            (by_label("configure"), Step::Configure, INACTIVE),
            (by_id(3), Step::Activate, ACTIVE),
            (by_id(4), Step::Deactivate, INACTIVE),
            (by_label("cleanup"), Step::Cleanup, UNCONFIGURED),
            (by_label("shutdown"), Step::Shutdown, FINALIZED),
        ] {
            assert_eq!(machine.begin(&wanted).and_then(Edge::step), Some(step));
            assert!(machine.begin(&wanted).is_none(), "one at a time");
            assert!(machine.end(true).is_some());
            assert_eq!(machine.state().id, after);
        }
        assert_eq!(machine.available().count(), 0);
    }

    #[test]
    fn a_failure_leads_back_and_what_is_not_possible_changes_nothing() {
        let mut machine = Machine::new();
        for refused in [
            by_label("activate"),
            by_id(2),
            by_id(10),
            by_id(6),
            by_id(0),
        ] {
            assert!(machine.begin(&refused).is_none());
            assert_eq!(machine.state().id, UNCONFIGURED);
        }
        assert!(machine.begin(&by_id(1)).is_some());
        assert!(
            machine.begin(&by_label(SUCCESS)).is_none(),
            "not by request"
        );
        assert_eq!(machine.end(false).map(|edge| edge.goal), Some(UNCONFIGURED));
    }

    #[test]
    fn tables_name_each_state_and_transition_once() {
        let mut ids: Vec<u8> = EDGES.iter().map(|edge| edge.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), EDGES.len());
        assert_eq!((states().len(), graph().len()), (11, 25));
        assert!(
            graph()
                .iter()
                .all(|edge| edge.goal_state.label != "unknown")
        );
    }
}
