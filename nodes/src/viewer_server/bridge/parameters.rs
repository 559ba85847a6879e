//! Access to node parameters through their services.

use futures::future::{BoxFuture, join_all};
use lattice_msgs::cdr;
use lattice_msgs::rcl_interfaces::{
    DescribeParameters, DescribeParametersRequest, DescribeParametersResponse, GetParameters,
    GetParametersRequest, GetParametersResponse, ListParameters, ListParametersRequest,
    ListParametersResponse, Parameter, ParameterEvent, ParameterValue, SetParameters,
    SetParametersRequest, SetParametersResponse,
};
use lattice_runtime::{CallError, Client, Node, RuntimeError};

use super::replies::{PATIENCE, answer};
use super::values::{from_json, to_json};
use crate::viewer_server::protocol::Value;

/// Limit of parameters requested per node.
const MAX_PARAMETERS: usize = 1000;

/// Values, and problems.
#[derive(Default)]
pub(super) struct Outcome {
    pub values: Vec<Value>,
    pub problems: Vec<String>,
}

/// Accessible nodes.
pub(super) struct Parameters(Vec<Remote>);

/// An accessible node.
#[derive(Clone)]
struct Remote {
    /// Full node name with a dot, the prefix of its parameter names.
    prefix: String,
    list: Client,
    describe: Client,
    get: Client,
    set: Client,
}

impl Parameters {
    pub(super) fn new(node: &Node, names: &[String]) -> Result<Self, RuntimeError> {
        let remote = |name: &String| {
            let list = node.client::<ListParameters>(&format!("{name}/list_parameters"))?;
            let full = list.name().trim_end_matches("/list_parameters");
            Ok(Remote {
                prefix: format!("{full}."),
                describe: node
                    .client::<DescribeParameters>(&format!("{name}/describe_parameters"))?,
                get: node.client::<GetParameters>(&format!("{name}/get_parameters"))?,
                set: node.client::<SetParameters>(&format!("{name}/set_parameters"))?,
                list,
            })
        };
        names.iter().map(remote).collect::<Result<_, _>>().map(Self)
    }

    /// Values of these parameters, or of all settable ones if none are named. Unavailable nodes
    /// are skipped.
    pub(super) fn get(&self, names: Vec<String>) -> BoxFuture<'static, Outcome> {
        let all = names.is_empty();
        let of = |remote: &Remote| {
            let names = names
                .iter()
                .filter_map(|name| name.strip_prefix(&remote.prefix));
            (remote.clone(), names.map(str::to_owned).collect::<Vec<_>>())
        };
        let nodes = self
            .0
            .iter()
            .map(of)
            .filter(|(_, names)| all || !names.is_empty());
        let nodes = nodes.map(|(remote, names)| async move {
            let names = match all {
                true => remote.changeable().await?,
                false => names,
            };
            remote.values(&names).await
        });
        let nodes = join_all(nodes.collect::<Vec<_>>());
        Box::pin(async move {
            let mut outcome = Outcome::default();
            for result in nodes.await {
                match result {
                    Ok(values) => outcome.values.extend(values),
                    Err(problem) if !all => outcome.problems.push(problem),
                    Err(problem) => log::debug!("parameters not read: {problem}"),
                }
            }
            outcome
        })
    }

    /// Values of a parameter event, if its node is accessible.
    pub(super) fn changed(&self, event: &ParameterEvent) -> Vec<Value> {
        let prefix = format!("{}.", event.node);
        let all = event.new_parameters.iter().chain(&event.changed_parameters);
        let value = |Parameter { name, value }: &Parameter| {
            let (value, kind) = to_json(value.clone())?;
            let name = format!("{prefix}{name}");
            Some(Value { name, value, kind })
        };
        match self.0.iter().any(|remote| remote.prefix == prefix) {
            true => all.filter_map(value).take(MAX_PARAMETERS).collect(),
            false => Vec::new(),
        }
    }

    /// Sets each parameter individually; returns their new values.
    pub(super) fn set(&self, parameters: Vec<Value>) -> BoxFuture<'static, Outcome> {
        let mut problems = Vec::new();
        let mut works = Vec::new();
        for parameter in parameters {
            let of = |remote: &&Remote| parameter.name.starts_with(&remote.prefix);
            match self.0.iter().find(of) {
                Some(remote) => works.push((remote.clone(), parameter)),
                None => problems.push(format!(
                    "{:?} is not accessible; see `parameter_nodes`",
                    parameter.name
                )),
            }
        }
        Box::pin(async move {
            let mut outcome = Outcome {
                problems,
                ..Outcome::default()
            };
            for (remote, parameter) in works {
                let name = parameter.name.clone();
                if let Err(problem) = remote.set(parameter).await {
                    outcome.problems.push(format!("{name}: {problem}"));
                }
                let name = name.strip_prefix(&remote.prefix).unwrap_or_default();
                let values = remote.values(&[name.to_owned()]).await;
                outcome.values.extend(values.into_iter().flatten());
            }
            outcome
        })
    }
}

impl Remote {
    async fn changeable(&self) -> Result<Vec<String>, String> {
        let request = ListParametersRequest::default();
        let list: ListParametersResponse = answer(ask(&self.list, &request)).await?;
        let mut names = list.result.names;
        names.truncate(MAX_PARAMETERS);
        let request = DescribeParametersRequest { names };
        let described: DescribeParametersResponse = answer(ask(&self.describe, &request)).await?;
        let changeable = described.descriptors.into_iter().filter(|of| !of.read_only);
        Ok(changeable.map(|of| of.name).collect())
    }

    async fn raw(&self, names: &[String]) -> Result<Vec<ParameterValue>, String> {
        let names = names.to_vec();
        let request = GetParametersRequest { names };
        let got: GetParametersResponse = answer(ask(&self.get, &request)).await?;
        Ok(got.values)
    }

    async fn values(&self, names: &[String]) -> Result<Vec<Value>, String> {
        let values = self.raw(names).await?;
        let value = |(name, value): (&String, ParameterValue)| {
            let (value, kind) = to_json(value)?;
            let name = format!("{}{name}", self.prefix);
            Some(Value { name, value, kind })
        };
        Ok(names.iter().zip(values).filter_map(value).collect())
    }

    async fn set(&self, parameter: Value) -> Result<(), String> {
        let name = parameter.name.strip_prefix(&self.prefix);
        let name = name.unwrap_or_default().to_owned();
        let known = self.raw(std::slice::from_ref(&name)).await?;
        let type_ = known.first().map_or(0, |value| value.type_);
        let value = from_json(parameter.value, type_)
            .ok_or("the value does not have the parameter's type")?;
        let parameters = vec![Parameter { name, value }];
        let request = SetParametersRequest { parameters };
        let done: SetParametersResponse = answer(ask(&self.set, &request)).await?;
        match done.results.into_iter().find(|result| !result.successful) {
            Some(result) => Err(result.reason),
            None => Ok(()),
        }
    }
}

fn ask<M: lattice_msgs::RosMessage>(
    client: &Client,
    request: &M,
) -> impl Future<Output = Result<Vec<u8>, CallError>> + Send + 'static {
    // An encoding failure results in an error reply.
    client.call(cdr::to_vec(request).unwrap_or_default(), PATIENCE)
}
