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

/// Lets parameters be changed: `apply` is given all as they would be, and hands them to the node or says why
/// not.
pub fn open_params(
    params: &Params,
    apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static,
) {
    params.open(apply);
}

/// Most edits between the name of a topic and its misspelling.
const MAX_EDITS: usize = 2;

/// Refuses parameters `qos.TOPIC.*` whose topic is a misspelling of one that the started node has, and warns of
/// those of other topics: some nodes make topics later. `elsewhere` tells which another node of the process has.
pub fn check_topics(params: &Params, elsewhere: impl Fn(&str) -> bool) -> Result<(), ParamError> {
    let node = params.node().trim_start_matches('/');
    for unknown in params.without_topic() {
        // For all nodes: of one that has it, or in a file that others share.
        if !unknown.named && (unknown.place.is_some() || elsewhere(&unknown.name)) {
            continue;
        }
        let nearest = params.nearest(&unknown.name);
        let nearest = nearest.filter(|(_, edits)| *edits <= MAX_EDITS);
        let name = nearest.as_ref().map(|(name, _)| &**name);
        let error = unknown.error(node, name, "the node has no such topic by now");
        match name {
            Some(_) => return Err(error),
            None => log::warn!("{error}"),
        }
    }
    Ok(())
}

/// Answer to a change of parameters that has been handed over, or has found the inbox full.
pub fn handed_over(sent: bool) -> Result<(), String> {
    match sent {
        true => Ok(()),
        false => Err("busy, ask again".to_owned()),
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
