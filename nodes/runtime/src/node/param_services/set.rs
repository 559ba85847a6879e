//! Services that set parameters.
//!
//! They reply from a separate thread: a node parses all its options, and a clock may be subscribed to.

use std::sync::Arc;
use std::thread;

use lattice_msgs::RosService;
use lattice_msgs::rcl_interfaces::{
    Parameter, SetParameters, SetParametersAtomically, SetParametersAtomicallyResponse,
    SetParametersResponse, SetParametersResult,
};

use super::convert::value_from;
use crate::communication::service::Server;
use crate::config::params::{ParamValue, Params, Refusal};
use crate::error::RuntimeError;
use crate::node::logical_node::Node;

/// Limit of names or parameters per request; a larger request gets an empty reply.
pub(super) const MAX_NAMES: usize = 1000;

/// Serves `set_parameters`: each parameter is set individually.
pub(super) fn serve_each(node: &Node, params: &Arc<Params>) -> Result<Server, RuntimeError> {
    serve::<SetParameters>(node, "~/set_parameters", params, |params, request| {
        SetParametersResponse {
            results: set_each(params, request.parameters),
        }
    })
}

/// Serves `set_parameters_atomically`: all parameters are set, or none.
pub(super) fn serve_atomically(node: &Node, params: &Arc<Params>) -> Result<Server, RuntimeError> {
    let name = "~/set_parameters_atomically";
    serve::<SetParametersAtomically>(node, name, params, |params, request| {
        SetParametersAtomicallyResponse {
            result: set_all(params, request.parameters),
        }
    })
}

fn serve<S: RosService + 'static>(
    node: &Node,
    name: &str,
    params: &Arc<Params>,
    answer: fn(&Params, S::Request) -> S::Response,
) -> Result<Server, RuntimeError> {
    let params = Arc::clone(params);
    node.service_later::<S>(name, move |request, reply| {
        let params = Arc::clone(&params);
        let work = move || reply.send(answer(&params, request));
        let thread = thread::Builder::new().name("set parameters".to_owned());
        if let Err(error) = thread.spawn(work) {
            log::error!("parameters are not set: {error}");
        }
    })
}

fn set_each(params: &Params, wanted: Vec<Parameter>) -> Vec<SetParametersResult> {
    if wanted.len() > MAX_NAMES {
        return vec![too_many(); wanted.len()];
    }
    let set_one = |one: Parameter| match value_from(one.value) {
        Ok(value) => {
            let set = params.set(vec![(one.name, value)]);
            result(set.map_err(|refusal| refusal.to_string()))
        }
        Err(reason) => result(Err(reason)),
    };
    wanted.into_iter().map(set_one).collect()
}

fn set_all(params: &Params, wanted: Vec<Parameter>) -> SetParametersResult {
    if wanted.len() > MAX_NAMES {
        return too_many();
    }
    let wanted = wanted.into_iter();
    let values: Result<Vec<(String, Option<ParamValue>)>, String> = wanted
        .map(|one| Ok((one.name, value_from(one.value)?)))
        .collect();
    let set = |values| {
        params.set(values).map_err(|refusal| match refusal {
            Refusal::NotDeclared(_) => {
                "One or more parameters were not declared before setting".to_owned()
            }
            other => other.to_string(),
        })
    };
    result(values.and_then(set))
}

fn too_many() -> SetParametersResult {
    result(Err(format!("request exceeds {MAX_NAMES} parameters")))
}

fn result(set: Result<(), String>) -> SetParametersResult {
    SetParametersResult {
        successful: set.is_ok(),
        reason: set.err().unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::param_services::convert::messages;

    fn params() -> Params {
        let params = Params::default();
        params.describe(crate::about! { "a": "A."; "b": "B."; });
        params.i64("a", 1).unwrap();
        params.i64("b", 1).unwrap();
        params.open(|_| Ok(()));
        params
    }

    fn wanted(values: &[(&str, i64)]) -> Vec<Parameter> {
        let values = values.iter();
        messages(values.map(|(name, value)| ((*name).to_owned(), ParamValue::I64(*value))))
    }

    #[test]
    fn each_is_set_by_itself_or_all_together() {
        let (params, mixed) = (params(), wanted(&[("a", 2), ("none", 3), ("b", 4)]));
        let result = set_all(&params, mixed.clone());
        let reason = "One or more parameters were not declared before setting";
        assert_eq!((result.successful, result.reason.as_str()), (false, reason));
        assert_eq!(params.declared()["a"], ParamValue::I64(1));
        let results = set_each(&params, mixed);
        let done: Vec<bool> = results.iter().map(|result| result.successful).collect();
        assert_eq!(done, [true, false, true]);
        let reason = "parameter 'none' cannot be set because it was not declared";
        assert_eq!(results[1].reason, reason);
        assert_eq!(params.declared()["b"], ParamValue::I64(4));
        assert!(set_all(&params, wanted(&[("a", 7), ("b", 8)])).successful);
    }

    #[test]
    fn hostile_requests_are_refused() {
        let many = wanted(&vec![("a", 2); MAX_NAMES + 1]);
        assert!(
            set_each(&params(), many.clone())
                .iter()
                .all(|result| !result.successful)
        );
        assert!(!set_all(&params(), many).successful);
        assert!(set_each(&params(), Vec::new()).is_empty());
        assert!(!set_all(&params(), Vec::new()).successful);
        let mut bytes = wanted(&[("a", 2)]);
        bytes[0].value.type_ = 5;
        assert!(!set_each(&params(), bytes.clone())[0].successful);
        assert!(!set_all(&params(), bytes).successful);
    }
}
