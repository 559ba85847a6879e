//! States of managed nodes and their transitions.

use serde::{Deserialize, Serialize};

use crate::interface::{messages, services};

messages! {
    "lifecycle_msgs" in "../definitions/lifecycle_msgs/";
    State [];
    Transition [];
    TransitionDescription [Transition, State];
    TransitionEvent [Transition, State];
}

services! {
    "lifecycle_msgs" in "../definitions/lifecycle_msgs/";
    ChangeState: ChangeStateRequest [Transition], ChangeStateResponse [];
    GetState: GetStateRequest [], GetStateResponse [State];
    GetAvailableStates: GetAvailableStatesRequest [], GetAvailableStatesResponse [State];
    GetAvailableTransitions: GetAvailableTransitionsRequest [], GetAvailableTransitionsResponse [TransitionDescription];
}

/// A state of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Number of the state; 1 to 4 are unconfigured, inactive, active, finalized.
    pub id: u8,
    /// Its name.
    pub label: String,
}

impl State {
    /// No state.
    pub const PRIMARY_STATE_UNKNOWN: u8 = 0;
    /// Nothing is held.
    pub const PRIMARY_STATE_UNCONFIGURED: u8 = 1;
    /// Resources are held; nothing is heard or published.
    pub const PRIMARY_STATE_INACTIVE: u8 = 2;
    /// The node is at work.
    pub const PRIMARY_STATE_ACTIVE: u8 = 3;
    /// The node is to be ended.
    pub const PRIMARY_STATE_FINALIZED: u8 = 4;
}

/// A way from one state to another.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transition {
    /// Number of the transition.
    pub id: u8,
    /// Its name, which counts before the number where it is given.
    pub label: String,
}

impl Transition {
    /// Takes up resources.
    pub const TRANSITION_CONFIGURE: u8 = 1;
    /// Gives resources back.
    pub const TRANSITION_CLEANUP: u8 = 2;
    /// Begins to work.
    pub const TRANSITION_ACTIVATE: u8 = 3;
    /// Ceases to work.
    pub const TRANSITION_DEACTIVATE: u8 = 4;
}

/// A transition with its ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransitionDescription {
    /// The transition.
    pub transition: Transition,
    /// State before it.
    pub start_state: State,
    /// State after it.
    pub goal_state: State,
}

/// A transition that has happened.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransitionEvent {
    /// Time of it, ns since 1970.
    pub timestamp: u64,
    /// The transition.
    pub transition: Transition,
    /// State before it.
    pub start_state: State,
    /// State after it.
    pub goal_state: State,
}

/// Takes a node from one state to another.
#[derive(Clone, Copy, Debug)]
pub struct ChangeState;

/// Request of [`ChangeState`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeStateRequest {
    /// The transition wanted.
    pub transition: Transition,
}

/// Response of [`ChangeState`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeStateResponse {
    /// True: the node is in the state wanted.
    pub success: bool,
}

/// Names the state of a node.
#[derive(Clone, Copy, Debug)]
pub struct GetState;

/// Request of [`GetState`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetStateRequest {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GetState`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetStateResponse {
    /// State of the node.
    pub current_state: State,
}

/// Lists the states that a node knows.
#[derive(Clone, Copy, Debug)]
pub struct GetAvailableStates;

/// Request of [`GetAvailableStates`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetAvailableStatesRequest {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GetAvailableStates`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetAvailableStatesResponse {
    /// The states.
    pub available_states: Vec<State>,
}

/// Lists transitions: those from the state of a node, or all.
#[derive(Clone, Copy, Debug)]
pub struct GetAvailableTransitions;

/// Request of [`GetAvailableTransitions`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetAvailableTransitionsRequest {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GetAvailableTransitions`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetAvailableTransitionsResponse {
    /// The transitions.
    pub available_transitions: Vec<TransitionDescription>,
}
