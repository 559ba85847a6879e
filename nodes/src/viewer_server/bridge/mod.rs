//! The bridge from clients to nodes: a fixed table of services, parameters of named nodes, one topic.

mod parameters;
mod services;
mod values;

use std::sync::Arc;
use std::time::Duration;

use futures::future::BoxFuture;
use lattice_msgs::RosMessage;
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::rcl_interfaces::ParameterEvent;
use lattice_runtime::qos::Qos;
use lattice_runtime::{CallError, Client, Load, Node, Publisher, Subscription};

use self::parameters::Parameters;
use super::desk::{Ask, Offer, OpenTopic};
use super::hub::Hub;
use super::outbox::Outgoing;
use super::protocol::{parameter_values, service_failure, service_response, status};
use crate::start::NodeError;

/// Time for an answer of a node.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest answer that is passed on, and longest message of a client.
const MAX_ANSWER_BYTES: usize = 1 << 20;

/// Answers what clients ask.
pub trait Bridge: Send + Sync {
    /// All that clients may ask for.
    fn offer(&self) -> &Offer;

    /// Asks; gives messages for the client. Dropping the future ends the question.
    fn ask(&self, ask: Ask) -> BoxFuture<'static, Vec<Outgoing>>;
}

/// Nodes that clients reach.
#[derive(Clone, Debug)]
pub struct Reach {
    /// True if clients may change something.
    pub allow_write: bool,
    /// The mapper.
    pub mapper: String,
    /// The player of logs.
    pub player: String,
    /// Nodes whose parameters are shown and set.
    pub parameter_nodes: Vec<String>,
    /// Topic of goals (`geometry_msgs/PoseStamped`).
    pub goal_topic: String,
}

/// A bridge to nodes of ROS.
pub struct NodeBridge {
    offer: Offer,
    clients: Vec<Client>,
    parameters: Arc<Parameters>,
    _events: Option<Subscription>,
    goals: Option<Publisher<PoseStamped>>,
}

impl NodeBridge {
    /// A bridge that offers what `reach` allows, and tells the hub of parameters that change.
    pub fn new(node: &Node, reach: &Reach, hub: &Arc<Hub>) -> Result<Self, NodeError> {
        let (services, clients) = services::of(node, reach)?;
        let mut offer = Offer {
            services,
            parameters: reach.allow_write,
            graph: true,
            ..Offer::default()
        };
        let mut goals = None;
        let mut nodes: &[String] = &[];
        if reach.allow_write {
            nodes = &reach.parameter_nodes;
            let (name, type_name) = (node.resolve(&reach.goal_topic)?, PoseStamped::TYPE);
            goals = Some(node.publisher(&reach.goal_topic, Qos::DEFAULT)?);
            offer.topics.push(OpenTopic { name, type_name });
        }
        let parameters = Arc::new(Parameters::new(node, nodes)?);
        let mut events = None;
        if reach.allow_write {
            // The hub holds the bridge.
            let (hub, parameters) = (Arc::downgrade(hub), Arc::clone(&parameters));
            let tell = move |event: Arc<ParameterEvent>| {
                if let Some(hub) = hub.upgrade() {
                    hub.parameters_changed(&parameters.changed(&event));
                }
            };
            let qos = Qos::PARAMETER_EVENTS;
            events = Some(node.subscribe("/parameter_events", qos, Load::Small, tell)?);
        }
        Ok(Self {
            offer,
            clients,
            parameters,
            _events: events,
            goals,
        })
    }

    /// Publishes a goal: the only topic of the offer.
    fn publish(&self, message: &[u8]) -> Result<(), String> {
        let message: PoseStamped = lattice_msgs::cdr::from_slice(message).map_err(words)?;
        match &self.goals {
            Some(goals) => goals.publish(message).map_err(words),
            None => Err("goals are not taken".to_owned()),
        }
    }
}

impl Bridge for NodeBridge {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn ask(&self, ask: Ask) -> BoxFuture<'static, Vec<Outgoing>> {
        match ask {
            Ask::Call {
                service,
                call,
                request,
            } => {
                let client = self.clients.get(service as usize);
                let answer = client.map(|client| client.call(request, PATIENCE));
                Box::pin(async move {
                    let answer = match answer {
                        Some(answer) => answer.await.map_err(words),
                        None => Err("there is no such service".to_owned()),
                    };
                    vec![match answer {
                        Ok(cdr) if cdr.len() <= MAX_ANSWER_BYTES => {
                            Outgoing::Binary(service_response(service, call, &cdr))
                        }
                        Ok(_) => Outgoing::Text(service_failure(service, call, "a long answer")),
                        Err(why) => Outgoing::Text(service_failure(service, call, &why)),
                    }]
                })
            }
            Ask::GetParameters(names, id) => {
                let values = self.parameters.get(names);
                Box::pin(async move { told(values.await, id) })
            }
            Ask::SetParameters(parameters, id) => {
                let values = self.parameters.set(parameters);
                Box::pin(async move { told(values.await, id) })
            }
            Ask::Publish(_, message) => {
                let problem = self.publish(&message).err();
                let told = problem.map(|why| Outgoing::Text(status(&why)));
                Box::pin(async move { told.into_iter().collect() })
            }
        }
    }
}

/// Values, and before them what went wrong.
fn told(outcome: parameters::Outcome, id: Option<String>) -> Vec<Outgoing> {
    let problems = outcome.problems.iter().map(|why| status(why));
    let values = parameter_values(&outcome.values, id.as_deref());
    problems.chain([values]).map(Outgoing::Text).collect()
}

fn words(error: impl ToString) -> String {
    error.to_string()
}

/// The answer to a typed call.
async fn answer<M: RosMessage>(
    call: impl Future<Output = Result<Vec<u8>, CallError>>,
) -> Result<M, String> {
    let cdr = call.await.map_err(words)?;
    lattice_msgs::cdr::from_slice(&cdr).map_err(words)
}
