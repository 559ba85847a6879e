//! Parameter services of a node and its `/parameter_events`, for `ros2 param` and similar tools.

mod convert;
mod set;

use std::collections::BTreeSet;
use std::sync::Arc;

use lattice_msgs::RosService;
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::rcl_interfaces::{
    DescribeParameters, DescribeParametersRequest, DescribeParametersResponse, GetParameterTypes,
    GetParameterTypesRequest, GetParameterTypesResponse, GetParameters, GetParametersRequest,
    GetParametersResponse, ListParameters, ListParametersRequest, ListParametersResponse,
    ListParametersResult, ParameterDescriptor, ParameterEvent, ParameterType,
};

use self::convert::{descriptor, messages, value_message};
use self::set::MAX_NAMES;
use super::logical_node::Node;
use crate::communication::service::Server;
use crate::config::params::{ParamValue, Params};
use crate::error::RuntimeError;
use crate::transport::qos::Qos;

/// Limit of array items plus string bytes per reply.
const MAX_ANSWER_LENGTH: usize = 1 << 20;

/// Serves the six parameter services of `node` while the servers exist, and publishes new and
/// changed parameters.
pub(crate) fn serve(node: &Node, params: &Arc<Params>) -> Result<Vec<Server>, RuntimeError> {
    // Older access permissions do not include the events.
    if let Err(error) = tell_events(node, params) {
        log::warn!("parameter events are not published: {error}");
    }
    Ok(vec![
        answer::<GetParameters>(node, "~/get_parameters", params, get_values)?,
        answer::<GetParameterTypes>(node, "~/get_parameter_types", params, get_types)?,
        answer::<ListParameters>(node, "~/list_parameters", params, list_names)?,
        answer::<DescribeParameters>(node, "~/describe_parameters", params, describe_all)?,
        set::serve_each(node, params)?,
        set::serve_atomically(node, params)?,
    ])
}

fn tell_events(node: &Node, params: &Params) -> Result<(), RuntimeError> {
    let publisher = node.publisher_as_is("/parameter_events", Qos::PARAMETER_EVENTS)?;
    let (clock, name) = (node.clock(), node.fqn().to_owned());
    params.listen(move |new, changed| {
        let event = ParameterEvent {
            stamp: Time::from_ns(clock.now_ns()),
            node: name.clone(),
            new_parameters: messages(new),
            changed_parameters: messages(changed),
            deleted_parameters: Vec::new(),
        };
        if let Err(error) = publisher.publish(event) {
            log::debug!("event not published: {error}");
        }
    });
    Ok(())
}

fn answer<S: RosService + 'static>(
    node: &Node,
    name: &str,
    params: &Arc<Params>,
    answer: fn(&Params, &S::Request) -> S::Response,
) -> Result<Server, RuntimeError> {
    let params = Arc::clone(params);
    node.service::<S>(name, move |request| answer(&params, &request))
}

fn get_values(params: &Params, request: &GetParametersRequest) -> GetParametersResponse {
    let declared = params.declared();
    let values = || {
        bounded(&request.names)
            .iter()
            .map(|name| declared.get(name))
    };
    // A small request can name a large value many times.
    let length: usize = values().flatten().map(ParamValue::length).sum();
    if length > MAX_ANSWER_LENGTH {
        log::warn!(
            "parameter values of {length} bytes and items exceed {MAX_ANSWER_LENGTH}; replied with none"
        );
        return GetParametersResponse::default();
    }
    let message = |value: Option<&ParamValue>| value.map(value_message).unwrap_or_default();
    GetParametersResponse {
        values: values().map(message).collect(),
    }
}

fn get_types(params: &Params, request: &GetParameterTypesRequest) -> GetParameterTypesResponse {
    let declared = params.declared();
    let names = bounded(&request.names).iter();
    let types: Vec<u8> = names.map(|name| type_of(declared.get(name))).collect();
    GetParameterTypesResponse {
        types: types.into(),
    }
}

fn describe_all(
    params: &Params,
    request: &DescribeParametersRequest,
) -> DescribeParametersResponse {
    let all = params.described();
    let describe = |name: &String| match all.get(name) {
        Some(declared) => descriptor(name, declared),
        None => ParameterDescriptor {
            name: name.clone(),
            ..ParameterDescriptor::default()
        },
    };
    DescribeParametersResponse {
        descriptors: bounded(&request.names).iter().map(describe).collect(),
    }
}

/// Names of a request; empty if there are too many.
fn bounded<T>(names: &[T]) -> &[T] {
    match names.len() <= MAX_NAMES {
        true => names,
        false => &[],
    }
}

fn list_names(params: &Params, request: &ListParametersRequest) -> ListParametersResponse {
    let levels_allow = |rest: &str| {
        let levels = u64::try_from(rest.matches('.').count()).unwrap_or(u64::MAX);
        request.depth == ListParametersRequest::DEPTH_RECURSIVE || levels < request.depth
    };
    let wanted = |name: &str| {
        let below = |prefix: &String| match name.strip_prefix(prefix.as_str()) {
            Some("") => true,
            Some(rest) => rest.strip_prefix('.').is_some_and(levels_allow),
            None => false,
        };
        match request.prefixes.is_empty() {
            true => levels_allow(name),
            false => request.prefixes.iter().any(below),
        }
    };
    let mut names: Vec<String> = params.declared().into_keys().collect();
    names.retain(|name| wanted(name));
    let prefix = |name: &String| Some(name.rsplit_once('.')?.0.to_owned());
    let prefixes: BTreeSet<String> = names.iter().filter_map(prefix).collect();
    ListParametersResponse {
        result: ListParametersResult {
            names,
            prefixes: prefixes.into_iter().collect(),
        },
    }
}

fn type_of(declared: Option<&ParamValue>) -> u8 {
    declared.map_or(ParameterType::PARAMETER_NOT_SET, ParamValue::type_code)
}

#[cfg(test)]
mod tests {
    use lattice_msgs::rcl_interfaces::ParameterValue;

    use super::*;

    fn params() -> Params {
        let params = Params::from_values("/n", [("lattice", ParamValue::String("fcc".to_owned()))]);
        params.string("lattice", "bcc").unwrap();
        params.f64("cell_volume_m3", 0.125).unwrap();
        params.i64("qos.map.depth", 500).unwrap();
        params
    }

    fn list(prefixes: &[&str], depth: u64) -> ListParametersResult {
        let request = ListParametersRequest {
            prefixes: prefixes.iter().map(|&p| p.to_owned()).collect(),
            depth,
        };
        list_names(&params(), &request).result
    }

    #[test]
    fn values_and_types_are_given() {
        let names = || ["lattice", "cell_volume_m3", "none"].map(str::to_owned);
        let request = GetParametersRequest {
            names: names().into(),
        };
        let values = get_values(&params(), &request).values;
        assert_eq!(values[0].string_value, "fcc");
        assert_eq!(values[1].double_value, 0.125);
        assert_eq!(values[2], ParameterValue::default());
        let request = GetParameterTypesRequest {
            names: names().into(),
        };
        assert_eq!(get_types(&params(), &request).types.as_slice(), [4, 3, 0]);
        let names = names().into();
        let descriptors = describe_all(&params(), &DescribeParametersRequest { names }).descriptors;
        assert!(descriptors[0].read_only && descriptors[2].type_ == 0);
        let names = vec!["lattice".to_owned(); MAX_NAMES + 1];
        assert!(
            get_values(&params(), &GetParametersRequest { names })
                .values
                .is_empty()
        );
    }

    #[test]
    fn a_large_value_is_not_given_a_thousand_times() {
        let classes = ParamValue::I64Array(vec![1; MAX_ANSWER_LENGTH / 500]);
        let params = Params::from_values("/n", [("ignored_labels", classes)]);
        params.i64_array("ignored_labels", &[]).unwrap();
        let values = |n: usize| {
            let names = vec!["ignored_labels".to_owned(); n];
            get_values(&params, &GetParametersRequest { names })
                .values
                .len()
        };
        assert_eq!((values(499), values(501)), (499, 0));
    }

    #[test]
    fn lists_follow_prefix_and_depth() {
        let all = ["cell_volume_m3", "lattice", "qos.map.depth"];
        assert_eq!(list(&[], 0).names, all);
        assert_eq!(list(&[], 0).prefixes, ["qos.map"]);
        assert_eq!(list(&[], 1).names, ["cell_volume_m3", "lattice"]);
        assert_eq!(list(&["qos"], 0).names, ["qos.map.depth"]);
        assert_eq!(list(&["qos"], 1).names, [""; 0]);
        let both = list(&["qos.map", "lattice"], 1);
        assert_eq!(both.names, ["lattice", "qos.map.depth"]);
        assert_eq!(list(&["latt"], 0).names, [""; 0]);
    }
}
