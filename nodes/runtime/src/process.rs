//! The runtime of a process: one participant, its threads, and the nodes on it.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use lattice_msgs::diagnostic_msgs::DiagnosticArray;

use super::env::Network;
use super::error::RuntimeError;
use super::logger_services;
use super::node::Node;
use super::outbox::WhenFull;
use super::param_services;
use super::qos::Qos;
use super::ros_args::RosArgs;
use super::rosout;
use super::security::Enclave;
use super::shared::{Shared, deadline};
use super::shutdown::{Shutdown, SignalWatch};
use super::sync::lock;
use super::timer::Timer;
use super::type_description;

/// Between two messages on `/diagnostics`.
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

/// Runs the nodes of a process. Dropping it closes the participant, and peers see it go at once.
///
/// SIGINT and SIGTERM ask for shutdown while it lives. Not to be dropped on one of its own threads.
pub struct Runtime {
    shared: Arc<Shared>,
    args: Arc<RosArgs>,
    main: Node,
    /// All nodes, by their names in the code.
    nodes: Mutex<Vec<(String, Node)>>,
    _signals: SignalWatch,
    _rosout: Option<Arc<rosout::Listener>>,
}

impl Runtime {
    /// Starts the runtime and its main node, on the network that the environment names.
    pub fn start(default_node_name: &str, args: RosArgs) -> Result<Self, RuntimeError> {
        Self::with_transport(default_node_name, args, &Network::from_env()?)
    }

    /// The same on a network that is given.
    pub fn with_transport(
        default_node_name: &str,
        args: RosArgs,
        network: &Network,
    ) -> Result<Self, RuntimeError> {
        for warning in &network.warnings {
            log::warn!("{warning}");
        }
        for note in &network.notes {
            log::info!("{note}");
        }
        let name = args.enclave.clone().unwrap_or_else(|| "/".to_owned());
        let secrets = match &network.security {
            Some(security) => security.secrets(&name)?,
            None => None,
        };
        let shared = Shared::start(network, &Enclave { name, secrets })?;
        shared.receive_buffer.warn_if_short();
        let signals = SignalWatch::start(shared.shutdown.clone())?;
        let args = Arc::new(args);
        let main = node(&shared, &args, default_node_name)?;
        let mut runtime = Self {
            shared,
            args,
            nodes: Mutex::new(vec![(default_node_name.to_owned(), main.clone())]),
            main,
            _signals: signals,
            _rosout: None,
        };
        runtime.publish_diagnostics()?;
        if !runtime.args.no_rosout_logs {
            runtime._rosout = Some(runtime.publish_log()?);
        }
        Ok(runtime)
    }

    /// The node called `default_name` in the code, made when it is first asked for.
    pub fn node(&self, default_name: &str) -> Result<Node, RuntimeError> {
        let mut nodes = lock(&self.nodes);
        if let Some((_, node)) = nodes.iter().find(|(name, _)| name == default_name) {
            return Ok(node.clone());
        }
        let node = node(&self.shared, &self.args, default_name)?;
        nodes.push((default_name.to_owned(), node.clone()));
        Ok(node)
    }

    /// Calls `callback` in every period of the system's steady clock, 1 ms at least, until shutdown or until
    /// the timer is dropped; never with a period of zero. The period can be changed.
    ///
    /// It runs on the io thread and must return at once. Periods that were missed are left out.
    pub fn timer(&self, period: Duration, callback: impl FnMut() + Send + 'static) -> Timer {
        Timer::start(&self.shared.io, period, callback)
    }

    /// A handle to ask for shutdown.
    pub fn shutdown_handle(&self) -> Shutdown {
        self.shared.shutdown.clone()
    }

    /// Blocks until shutdown is asked for, then ends timers, sends what is queued, and leaves.
    ///
    /// The error is a thread that panicked.
    pub fn spin(&self) -> Result<(), RuntimeError> {
        self.shared.shutdown.wait();
        self.shared.close();
        match self.shared.shutdown.failed_thread() {
            Some(thread) => Err(RuntimeError::Panicked { thread }),
            None => Ok(()),
        }
    }

    /// Waits until the handlers have had every message that waits in this process, for two seconds at
    /// most. Not from a handler, callback or timer.
    pub fn work_off(&self) {
        self.shared.work_off(deadline());
    }

    fn publish_log(&self) -> Result<Arc<rosout::Listener>, RuntimeError> {
        let topic = self.main.resolve("/rosout")?;
        let publisher =
            self.shared
                .publisher(self.main.id(), &topic, &Qos::ROSOUT, WhenFull::Drop)?;
        let (listener, records) = rosout::listen();
        if let Some(task) = self.shared.io.spawn(rosout::publish(records, publisher)) {
            task.detach();
        }
        Ok(listener)
    }

    fn publish_diagnostics(&self) -> Result<(), RuntimeError> {
        let topic = self.main.resolve("/diagnostics")?;
        let publisher = self.shared.publisher::<DiagnosticArray>(
            self.main.id(),
            &topic,
            &Qos::DIAGNOSTICS,
            WhenFull::Drop,
        )?;
        let shared = Arc::downgrade(&self.shared);
        let (clock, fqn) = (self.main.clock(), self.main.fqn().to_owned());
        let timer = self.timer(DIAGNOSTICS_PERIOD, move || {
            if let Some(shared) = shared.upgrade() {
                let transport = shared.transport_status(&fqn);
                let message = shared.tasks.message(clock.now_ns(), transport);
                // A full queue is counted, and stated in the next message.
                let _ = publisher.publish(message);
            }
        });
        timer.detach();
        Ok(())
    }
}

/// A node with its parameter services.
fn node(
    shared: &Arc<Shared>,
    args: &Arc<RosArgs>,
    default_name: &str,
) -> Result<Node, RuntimeError> {
    let node = Node::new(shared, args, default_name)?;
    shared.keep(type_description::serve(&node)?.into_iter().collect());
    shared.keep(logger_services::serve(&node)?.into());
    shared.keep(param_services::serve(&node, node.params())?);
    Ok(node)
}

impl Drop for Runtime {
    fn drop(&mut self) {
        self.shared.close();
    }
}
