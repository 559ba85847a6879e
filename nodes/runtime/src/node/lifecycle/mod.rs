//! Managed nodes: the services and the event topic of `rclcpp_lifecycle`.

mod machine;

pub use machine::Step;

use std::sync::{Arc, Mutex};
use std::time::{SystemTime, UNIX_EPOCH};

use lattice_msgs::lifecycle_msgs::{
    ChangeState, ChangeStateRequest, ChangeStateResponse, GetAvailableStates,
    GetAvailableStatesResponse, GetAvailableTransitions, GetAvailableTransitionsResponse, GetState,
    GetStateResponse, TransitionEvent,
};
use smol::channel::{Receiver, Sender, unbounded};
use smol::future::{block_on, or};

use crate::communication::publisher::Publisher;
use crate::communication::service::{Reply, Server};
use crate::config::names::shown;
use crate::error::RuntimeError;
use crate::node::logical_node::Node;
use crate::shutdown::Shutdown;
use crate::sync::lock;
use crate::transport::qos::Qos;
use machine::{Edge, Machine};

/// Request to change the state of a managed node.
pub struct ChangeRequest {
    /// Index of the node, as given to [`Lifecycle::serve`].
    pub node: usize,
    request: ChangeStateRequest,
    reply: Reply<ChangeStateResponse>,
}

/// Queue of requests to the managed nodes of a process, one per node at a time.
pub struct ChangeRequests {
    sender: Sender<ChangeRequest>,
    waiting: Receiver<ChangeRequest>,
}

impl Default for ChangeRequests {
    fn default() -> Self {
        let (sender, waiting) = unbounded();
        Self { sender, waiting }
    }
}

impl ChangeRequests {
    /// Blocks until the next request; `None` after a shutdown request.
    pub fn next(&self, shutdown: &Shutdown) -> Option<ChangeRequest> {
        let ended = async {
            shutdown.requested().await;
            None
        };
        block_on(or(ended, async { self.waiting.recv().await.ok() }))
    }

    /// Rejects pending and further requests.
    pub fn end(&self) {
        self.waiting.close();
        while let Ok(change) = self.waiting.try_recv() {
            change.reply.send(ChangeStateResponse { success: false });
        }
    }
}

/// A managed node. It begins in the state unconfigured.
pub struct Lifecycle {
    node: Node,
    machine: Arc<Mutex<Machine>>,
    events: Publisher<TransitionEvent>,
    _servers: Vec<Server>,
}

impl Lifecycle {
    /// Serves the five lifecycle services of a node, which is inactive until it is activated. Change requests go
    /// to `requests` with `index`.
    pub fn serve(
        node: &Node,
        index: usize,
        requests: &ChangeRequests,
    ) -> Result<Self, RuntimeError> {
        let machine = Arc::new(Mutex::new(Machine::new()));
        let events = node.publisher("~/transition_event", Qos::DEFAULT)?;
        let events = Publisher {
            gate: None,
            ..events
        };
        node.gate().set(false);
        let sender = requests.sender.clone();
        let change = move |request, reply| {
            // The receiver lives as long as the process serves requests.
            let _ = sender.try_send(ChangeRequest {
                node: index,
                request,
                reply,
            });
        };
        let state = Arc::clone(&machine);
        let edges = Arc::clone(&machine);
        let servers = vec![
            node.service_later::<ChangeState>("~/change_state", change)?,
            node.service::<GetState>("~/get_state", move |_| GetStateResponse {
                current_state: lock(&state).state(),
            })?,
            node.service::<GetAvailableStates>("~/get_available_states", |_| {
                GetAvailableStatesResponse {
                    available_states: machine::states(),
                }
            })?,
            node.service::<GetAvailableTransitions>("~/get_available_transitions", move |_| {
                let available = lock(&edges).available().map(Edge::message).collect();
                GetAvailableTransitionsResponse {
                    available_transitions: available,
                }
            })?,
            node.service::<GetAvailableTransitions>("~/get_transition_graph", |_| {
                GetAvailableTransitionsResponse {
                    available_transitions: machine::graph(),
                }
            })?,
        ];
        Ok(Self {
            node: node.clone(),
            machine,
            events,
            _servers: servers,
        })
    }

    /// Executes a change request: `work` runs the transition callback and returns its error.
    pub fn change(&self, change: ChangeRequest, work: impl FnOnce(Step) -> Result<(), String>) {
        let wanted = &change.request.transition;
        let begun = lock(&self.machine).begin(wanted);
        let name = self.node.fqn();
        let (Some(edge), Some(step)) = (begun, begun.and_then(Edge::step)) else {
            let state = lock(&self.machine).state().label;
            let (id, label) = (wanted.id, shown(&wanted.label));
            log::error!("{name}: no transition {id} {label:?} in state {state}");
            change.reply.send(ChangeStateResponse { success: false });
            return;
        };
        self.tell(edge);
        if matches!(step, Step::Deactivate | Step::Shutdown) {
            self.node.gate().set(false);
        }
        let result = work(step);
        if let Err(problem) = &result {
            log::error!("{name}: {problem}");
        }
        let success = result.is_ok();
        if let Some(edge) = lock(&self.machine).end(success) {
            self.tell(edge);
        }
        if success && step == Step::Activate {
            self.node.gate().set(true);
        }
        if matches!(step, Step::Cleanup | Step::Shutdown) {
            self.node.diagnostics().end();
        }
        log::info!("{name}: {}", lock(&self.machine).state().label);
        change.reply.send(ChangeStateResponse { success });
    }

    fn tell(&self, edge: Edge) {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let edge = edge.message();
        let event = TransitionEvent {
            timestamp: since.map_or(0, |since| since.as_nanos() as u64),
            transition: edge.transition,
            start_state: edge.start_state,
            goal_state: edge.goal_state,
        };
        if let Err(error) = self.events.publish(event) {
            log::debug!("transition event not published: {error}");
        }
    }
}
