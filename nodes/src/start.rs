//! Contract between a node and the executable that starts it.

use std::any::Any;
use std::error::Error;

use lattice_runtime::Runtime;
use lattice_runtime::params::{ParamError, Params};

/// Any error that keeps a node from starting.
pub type NodeError = Box<dyn Error + Send + Sync>;

/// A node that is at work; calling it ends the node after it has worked off its inbox.
pub type Finish = Box<dyn FnOnce() -> Servers>;

/// Servers of a node that has ended. They may have answers to send: kept until the runtime has left.
pub type Servers = Box<dyn Any>;

/// Starts a node on a runtime under its name.
pub type Start = fn(&Runtime, &str) -> Result<Finish, NodeError>;

/// Reads all parameters of a node, as its start does.
pub type Declare = fn(&Params) -> Result<(), ParamError>;

/// Says which given parameters no part of a node has asked for, and lets the others be changed: `apply` is
/// given all as they would be, and hands them to the node or says why not.
pub fn open_params(
    params: &Params,
    apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static,
) {
    for name in params.unused() {
        log::warn!("parameter '{name}' is not known here: is it misspelt?");
    }
    params.open(apply);
}

/// Answer to a change of parameters that has been handed over, or has found the inbox full.
pub fn handed_over(sent: bool) -> Result<(), String> {
    match sent {
        true => Ok(()),
        false => Err("busy, ask again".to_owned()),
    }
}
