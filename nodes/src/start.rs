//! Interface between a node and its executable.

use std::any::Any;
use std::error::Error;
use std::time::Duration;

use lattice_runtime::Runtime;
use lattice_runtime::params::{ParamError, Params};

/// Time of an ending node for the messages that it has received; then keyframes among them are left out. With [`LAST_FLUSH`]
/// a process ends within 2 s of a signal.
pub const LAST_EVENTS: Duration = Duration::from_millis(500);
/// Time of an ending node, after [`LAST_EVENTS`], for the piece of work that it is in the middle of. Then it is abandoned.
pub const LAST_PIECE: Duration = Duration::from_millis(500);
/// Longest wait of an ending node for the acknowledgements of its last messages: a process ends within 2 s of a signal.
pub const LAST_FLUSH: Duration = Duration::from_millis(500);

/// Least time between two calls of work that is due once a second: resting timers call at whole seconds, some of them late.
pub const ONCE_A_SECOND: Duration = Duration::from_millis(900);

/// Error of starting a node.
pub type NodeError = Box<dyn Error + Send + Sync>;

/// A running node; calling it ends the node after processing its inbox.
pub type Finish = Box<dyn FnOnce() -> Servers>;

/// Servers of an ended node. They may have pending replies: kept until the runtime is closed.
pub type Servers = Box<dyn Any>;

/// Starts a node on a runtime under its name.
pub type Start = fn(&Runtime, &str) -> Result<Finish, NodeError>;

/// Declares all parameters of a node, as at its start.
pub type Declare = fn(&Params) -> Result<(), ParamError>;

/// Makes parameters settable: `apply` receives all candidate values, and passes them to the node or returns
/// the reason for rejecting them.
pub fn open_params(
    params: &Params,
    apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static,
) {
    params.open(apply);
}

/// Edit distance limit between a topic name and its misspelling.
const MAX_EDITS: usize = 2;

/// Rejects parameters `qos.TOPIC.*` whose topic is a misspelling of one of the started node, and warns about
/// those of other topics: some nodes create topics later. `elsewhere` is true for topics of other nodes in the process.
pub fn check_topics(params: &Params, elsewhere: impl Fn(&str) -> bool) -> Result<(), ParamError> {
    let node = params.node().trim_start_matches('/');
    for unknown in params.without_topic() {
        // Addressed to all nodes: valid for another node, or in a shared file.
        if !unknown.named && (unknown.place.is_some() || elsewhere(&unknown.name)) {
            continue;
        }
        let nearest = params.nearest(&unknown.name);
        let nearest = nearest.filter(|(_, edits)| *edits <= MAX_EDITS);
        let name = nearest.as_ref().map(|(name, _)| &**name);
        let error = unknown.error(node, name, "the node has no such topic yet");
        match name {
            Some(_) => return Err(error),
            None => log::warn!("{error}"),
        }
    }
    Ok(())
}

/// Result of a parameter change sent to the inbox.
pub fn handed_over(sent: bool) -> Result<(), String> {
    match sent {
        true => Ok(()),
        false => Err("the inbox of the node is full: call again".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use lattice_runtime::params::ParamValue;
    use lattice_runtime::qos::Qos;

    use super::*;

    #[test]
    fn the_qos_of_a_misspelt_topic_is_refused_and_that_of_a_later_one_is_not() {
        for (name, refused) in [
            ("qos.map.depth", false),
            ("qos.mop.depth", true),
            ("qos./camera/points.depth", false),
        ] {
            let params = Params::from_values("/mapper", [(name, ParamValue::I64(7))]);
            Qos::MAP.with_overrides(&params, "/map", "map").unwrap();
            let checked = check_topics(&params, |_| false);
            assert_eq!(checked.is_err(), refused, "{name}");
            if let Err(error) = checked {
                let expected =
                    "parameter 'qos.mop.depth' of mapper is unknown; did you mean 'qos.map.depth'?";
                assert_eq!(error.to_string(), expected);
            }
        }
    }
}
