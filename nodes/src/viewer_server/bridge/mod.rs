//! Bridge from clients to nodes: a fixed table of services, parameters of configured nodes, a goal topic, and
//! the headset topics.

mod headset;
mod mesh_chunks;
mod options;
mod parameters;
mod replies;
mod services;
mod values;

use std::sync::Arc;

use futures::future::BoxFuture;
use lattice_msgs::RosMessage;
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::rcl_interfaces::ParameterEvent;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher, Subscription, SubscriptionExecutor};

pub use self::headset::HeadsetTopics;
pub use self::options::{BridgeOptions, HeadsetLimits};
use self::parameters::Parameters;
use self::replies::words;
use super::broadcast::{Bridge, Broadcaster, Outgoing};
use super::protocol::{parameter_values, service_failure, service_response, status};
use super::session::{BridgeRequest, Input, InputRefusal, Inputs, Offer, OpenTopic};
use crate::start::NodeError;

/// Largest forwarded reply, and largest client message, bytes.
const MAX_ANSWER_BYTES: usize = 1 << 20;

/// Sends a client's message to the node's thread; false if the inbox is full.
pub type HandOver = Box<dyn Fn(u64, Input) -> bool + Send + Sync>;

/// Bridge from viewer clients to ROS nodes: services, parameters, goals and headset messages.
pub struct NodeBridge {
    offer: Offer,
    clients: services::Clients,
    parameters: Arc<Parameters>,
    _events: Option<Subscription>,
    goals: Option<Publisher<PoseStamped>>,
    inputs: Arc<Inputs>,
    hand_over: HandOver,
}

impl NodeBridge {
    /// Creates a bridge limited by `reach`, which notifies the broadcaster of parameter changes. Headset messages of
    /// clients are passed to `hand_over`, and published by the returned topics.
    pub fn new(
        node: &Node,
        reach: &BridgeOptions,
        broadcaster: &Arc<Broadcaster>,
        (inputs, hand_over): (Arc<Inputs>, HandOver),
    ) -> Result<(Self, HeadsetTopics), NodeError> {
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
            offer.topics.push(OpenTopic {
                name,
                type_name,
                stream_bytes: None,
            });
        }
        let mut topics = HeadsetTopics::default();
        if let Some(headset) = &reach.headset {
            offer.stream_bytes_per_s = headset.bytes_per_s;
            topics = HeadsetTopics::new(node, headset.message_bytes, &mut offer.topics)?;
        }
        let parameters = Arc::new(Parameters::new(node, nodes)?);
        let mut events = None;
        if reach.allow_write {
            // Weak: the broadcaster owns the bridge.
            let (broadcaster, parameters) = (Arc::downgrade(broadcaster), Arc::clone(&parameters));
            let tell = move |event: Arc<ParameterEvent>| {
                if let Some(broadcaster) = broadcaster.upgrade() {
                    broadcaster.parameters_changed(&parameters.changed(&event));
                }
            };
            let qos = Qos::PARAMETER_EVENTS;
            events = Some(node.subscribe(
                "/parameter_events",
                qos,
                SubscriptionExecutor::Shared,
                tell,
            )?);
        }
        let bridge = Self {
            offer,
            clients,
            parameters,
            _events: events,
            goals,
            inputs,
            hand_over,
        };
        Ok((bridge, topics))
    }

    /// Publishes a goal: the only published topic with replies.
    fn publish(&self, message: &[u8]) -> Result<(), String> {
        let message: PoseStamped = lattice_msgs::cdr::from_slice(message).map_err(words)?;
        match &self.goals {
            Some(goals) => goals.publish(message).map_err(words),
            None => Err("publishing goals is not enabled".to_owned()),
        }
    }
}

impl Bridge for NodeBridge {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn take(&self, client: u64, input: Input) -> Result<(), InputRefusal> {
        match (self.hand_over)(client, input) {
            true => Ok(()),
            false => Err(InputRefusal::Busy),
        }
    }

    fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    fn request(&self, request: BridgeRequest) -> BoxFuture<'static, Vec<Outgoing>> {
        match request {
            BridgeRequest::Call {
                service,
                call,
                request,
            } => {
                let client = self.clients.get(service as usize);
                let answer = client.map(|(client, patience)| client.call(request, *patience));
                Box::pin(async move {
                    let answer = match answer {
                        Some(answer) => answer.await.map_err(words),
                        None => Err(format!(
                            "unknown service {service}; call one that was advertised"
                        )),
                    };
                    vec![match answer {
                        Ok(cdr) if cdr.len() <= MAX_ANSWER_BYTES => {
                            Outgoing::Binary(service_response(service, call, &cdr))
                        }
                        Ok(_) => Outgoing::Text(service_failure(
                            service,
                            call,
                            "the reply exceeds 1 MiB",
                        )),
                        Err(why) => Outgoing::Text(service_failure(service, call, &why)),
                    }]
                })
            }
            BridgeRequest::GetParameters(names, id) => {
                let values = self.parameters.get(names);
                Box::pin(async move { told(values.await, id) })
            }
            BridgeRequest::SetParameters(parameters, id) => {
                let values = self.parameters.set(parameters);
                Box::pin(async move { told(values.await, id) })
            }
            BridgeRequest::Publish(_, message) => {
                let problem = self.publish(&message).err();
                let told = problem.map(|why| Outgoing::Text(status(&why)));
                Box::pin(async move { told.into_iter().collect() })
            }
        }
    }
}

/// Messages of the problems and of the values.
fn told(outcome: parameters::Outcome, id: Option<String>) -> Vec<Outgoing> {
    let problems = outcome.problems.iter().map(|why| status(why));
    let values = parameter_values(&outcome.values, id.as_deref());
    problems.chain([values]).map(Outgoing::Text).collect()
}
