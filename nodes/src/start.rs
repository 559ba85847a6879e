//! Contract between a node and the executable that starts it.

use std::any::Any;
use std::error::Error;

use lattice_runtime::Runtime;
use lattice_runtime::params::Params;

/// Any error that keeps a node from starting.
pub type NodeError = Box<dyn Error + Send + Sync>;

/// A node that is at work; calling it ends the node after it has worked off its inbox.
pub type Finish = Box<dyn FnOnce() -> Servers>;

/// Servers of a node that has ended. They may have answers to send: kept until the runtime has left.
pub type Servers = Box<dyn Any>;

/// Starts a node on a runtime under its name.
pub type Start = fn(&Runtime, &str) -> Result<Finish, NodeError>;

/// Says which given parameters no part of a node has asked for.
pub fn warn_unused(params: &Params) {
    for name in params.unused() {
        log::warn!("parameter '{name}' is not known here: is it misspelt?");
    }
}
