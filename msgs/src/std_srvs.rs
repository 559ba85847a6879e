//! Calls of common use.

use serde::{Deserialize, Serialize};

use crate::interface::services;

services! {
    "std_srvs" in "../definitions/std_srvs/";
    Empty: EmptyRequest [], EmptyResponse [];
    Trigger: TriggerRequest [], TriggerResponse [];
    SetBool: SetBoolRequest [], SetBoolResponse [];
}

/// A call without arguments and without an answer.
#[derive(Clone, Copy, Debug)]
pub struct Empty;

/// Request of [`Empty`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EmptyRequest {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`Empty`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EmptyResponse {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// A call without arguments.
#[derive(Clone, Copy, Debug)]
pub struct Trigger;

/// Request of [`Trigger`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`Trigger`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// True: done.
    pub success: bool,
    /// Explanation of the outcome.
    pub message: String,
}

/// Switch something on or off.
#[derive(Clone, Copy, Debug)]
pub struct SetBool;

/// Request of [`SetBool`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetBoolRequest {
    /// True: on.
    pub data: bool,
}

/// Response of [`SetBool`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetBoolResponse {
    /// True: done.
    pub success: bool,
    /// Explanation of the outcome.
    pub message: String,
}
