//! Values, declarations and changes of the parameters of a node.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;

use super::about::{About, Declared};
use crate::config::param_value::ParamValue;

/// Parameters of one node.
///
/// Reading a parameter declares it; [`Params::open`] allows changes by services.
#[derive(Default)]
pub struct Params {
    pub(super) node: String,
    pub(super) state: Mutex<State>,
    pub(super) changes: Mutex<Changes>,
}

#[derive(Clone, Default)]
pub(super) struct State {
    pub(super) given: BTreeMap<String, Given>,
    pub(super) declared: BTreeMap<String, Declared>,
    pub(super) about: Vec<&'static [About]>,
}

/// A value with its origin.
#[derive(Clone, Debug)]
pub(super) struct Given {
    pub(super) value: ParamValue,
    pub(super) origin: Origin,
    /// True if it addresses this node by name; false if it addresses all nodes of the file or the arguments.
    pub(super) named: bool,
}

#[derive(Clone, Debug)]
pub(super) enum Origin {
    Default,
    CommandLine,
    Service,
    File { path: PathBuf, key: String },
}

/// Validates all candidate values, or returns the reason against them; then nothing changes.
pub(super) type Apply = Box<dyn FnMut(&Params) -> Result<(), String> + Send>;

/// Receives new and changed parameters.
pub(super) type Listener = Box<dyn FnMut(Values, Values) + Send>;

/// Parameters by name.
pub(crate) type Values = BTreeMap<String, ParamValue>;

/// Participants of a parameter change; one change at a time.
#[derive(Default)]
pub(super) struct Changes {
    /// Callback of the node; `None`: it is not running.
    pub node: Option<Apply>,
    pub apply: Vec<Apply>,
    pub is_open: bool,
    pub listener: Option<Listener>,
}
