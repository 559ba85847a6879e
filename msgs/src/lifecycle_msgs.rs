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
    /// Name of the state.
    pub label: String,
}

impl State {
    /// No state.
    pub const PRIMARY_STATE_UNKNOWN: u8 = 0;
    /// No resources are allocated.
    pub const PRIMARY_STATE_UNCONFIGURED: u8 = 1;
    /// Resources are allocated; messages are neither received nor published.
    pub const PRIMARY_STATE_INACTIVE: u8 = 2;
    /// The node is running.
    pub const PRIMARY_STATE_ACTIVE: u8 = 3;
    /// The node is to be destroyed.
    pub const PRIMARY_STATE_FINALIZED: u8 = 4;
    /// Transition state: configuring.
    pub const TRANSITION_STATE_CONFIGURING: u8 = 10;
    /// Transition state: cleaning up.
    pub const TRANSITION_STATE_CLEANINGUP: u8 = 11;
    /// Transition state: shutting down.
    pub const TRANSITION_STATE_SHUTTINGDOWN: u8 = 12;
    /// Transition state: activating.
    pub const TRANSITION_STATE_ACTIVATING: u8 = 13;
    /// Transition state: deactivating.
    pub const TRANSITION_STATE_DEACTIVATING: u8 = 14;
    /// Transition state: processing an error.
    pub const TRANSITION_STATE_ERRORPROCESSING: u8 = 15;
}

/// Transition between states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transition {
    /// Number of the transition.
    pub id: u8,
    /// Name of the transition; takes precedence over the number unless empty.
    pub label: String,
}

impl Transition {
    /// Creates the node.
    pub const TRANSITION_CREATE: u8 = 0;
    /// Acquires resources.
    pub const TRANSITION_CONFIGURE: u8 = 1;
    /// Releases resources.
    pub const TRANSITION_CLEANUP: u8 = 2;
    /// Starts operation.
    pub const TRANSITION_ACTIVATE: u8 = 3;
    /// Stops operation.
    pub const TRANSITION_DEACTIVATE: u8 = 4;
    /// Shuts an unconfigured node down.
    pub const TRANSITION_UNCONFIGURED_SHUTDOWN: u8 = 5;
    /// Shuts an inactive node down.
    pub const TRANSITION_INACTIVE_SHUTDOWN: u8 = 6;
    /// Shuts an active node down.
    pub const TRANSITION_ACTIVE_SHUTDOWN: u8 = 7;
    /// Destroys the node.
    pub const TRANSITION_DESTROY: u8 = 8;
    /// End of configure: success.
    pub const TRANSITION_ON_CONFIGURE_SUCCESS: u8 = 10;
    /// End of configure: failure.
    pub const TRANSITION_ON_CONFIGURE_FAILURE: u8 = 11;
    /// End of configure: error.
    pub const TRANSITION_ON_CONFIGURE_ERROR: u8 = 12;
    /// End of cleanup: success.
    pub const TRANSITION_ON_CLEANUP_SUCCESS: u8 = 20;
    /// End of cleanup: failure.
    pub const TRANSITION_ON_CLEANUP_FAILURE: u8 = 21;
    /// End of cleanup: error.
    pub const TRANSITION_ON_CLEANUP_ERROR: u8 = 22;
    /// End of activate: success.
    pub const TRANSITION_ON_ACTIVATE_SUCCESS: u8 = 30;
    /// End of activate: failure.
    pub const TRANSITION_ON_ACTIVATE_FAILURE: u8 = 31;
    /// End of activate: error.
    pub const TRANSITION_ON_ACTIVATE_ERROR: u8 = 32;
    /// End of deactivate: success.
    pub const TRANSITION_ON_DEACTIVATE_SUCCESS: u8 = 40;
    /// End of deactivate: failure.
    pub const TRANSITION_ON_DEACTIVATE_FAILURE: u8 = 41;
    /// End of deactivate: error.
    pub const TRANSITION_ON_DEACTIVATE_ERROR: u8 = 42;
    /// End of shutdown: success.
    pub const TRANSITION_ON_SHUTDOWN_SUCCESS: u8 = 50;
    /// End of shutdown: failure.
    pub const TRANSITION_ON_SHUTDOWN_FAILURE: u8 = 51;
    /// End of shutdown: error.
    pub const TRANSITION_ON_SHUTDOWN_ERROR: u8 = 52;
    /// End of error: success.
    pub const TRANSITION_ON_ERROR_SUCCESS: u8 = 60;
    /// End of error: failure.
    pub const TRANSITION_ON_ERROR_FAILURE: u8 = 61;
    /// End of error: error.
    pub const TRANSITION_ON_ERROR_ERROR: u8 = 62;
    /// Outcome of the work: success.
    pub const TRANSITION_CALLBACK_SUCCESS: u8 = 97;
    /// Outcome of the work: failure.
    pub const TRANSITION_CALLBACK_FAILURE: u8 = 98;
    /// Outcome of the work: error.
    pub const TRANSITION_CALLBACK_ERROR: u8 = 99;
}

/// Transition with its start and goal states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransitionDescription {
    /// The transition.
    pub transition: Transition,
    /// State before the transition.
    pub start_state: State,
    /// State after the transition.
    pub goal_state: State,
}

/// A completed transition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransitionEvent {
    /// Time of the transition, ns since 1970.
    pub timestamp: u64,
    /// The transition.
    pub transition: Transition,
    /// State before the transition.
    pub start_state: State,
    /// State after the transition.
    pub goal_state: State,
}

/// Takes a node from one state to another.
#[derive(Clone, Copy, Debug)]
pub struct ChangeState;

/// Request of [`ChangeState`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeStateRequest {
    /// Requested transition.
    pub transition: Transition,
}

/// Response of [`ChangeState`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeStateResponse {
    /// True if the transition succeeded.
    pub success: bool,
}

/// Queries the state of a node.
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

/// Lists the states of a node.
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

/// Lists transitions: the available ones of a node, or all.
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
