//! Runtime of a process: one participant, its threads and its nodes.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use lattice_msgs::diagnostic_msgs::DiagnosticArray;

use super::logger_services;
use super::logical_node::Node;
use super::param_services;
use super::rosout;
use super::shared::{Shared, deadline};
use super::timer::Timer;
use super::type_description;
use crate::config::env::Network;
use crate::config::ros_args::RosArgs;
use crate::config::security::Enclave;
use crate::error::RuntimeError;
use crate::shutdown::{Shutdown, SignalWatch};
use crate::sync::lock;
use crate::transport::outbox::WhenFull;
use crate::transport::qos::Qos;

/// Period of `/diagnostics`.
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

/// Runs the nodes of a process. Dropping it closes the participant, which peers notice at once.
///
/// While it exists, SIGINT and SIGTERM request shutdown. Must not be dropped on one of its own threads.
///
/// ```no_run
/// use std::time::Duration;
///
/// use lattice_msgs::std_msgs::Bool;
/// use lattice_runtime::{Runtime, qos::Qos, ros_args::RosArgs};
///
/// let runtime = Runtime::start("pulse", RosArgs::parse(std::env::args())?)?;
/// let publisher = runtime.node("pulse")?.publisher("pulse", Qos::DEFAULT)?;
/// let _timer = runtime.timer(Duration::from_secs(1), move || {
///     let _ = publisher.publish(Bool { data: true });
/// });
/// runtime.spin()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Runtime {
    shared: Arc<Shared>,
    args: Arc<RosArgs>,
    main: Node,
    /// All nodes, by their default names.
    nodes: Mutex<Vec<(String, Node)>>,
    _signals: SignalWatch,
    _rosout: Option<Arc<rosout::Listener>>,
}

impl Runtime {
    /// Starts the runtime and its main node, on the network given by the environment.
    pub fn start(default_node_name: &str, args: RosArgs) -> Result<Self, RuntimeError> {
        Self::with_transport(default_node_name, args, &Network::from_env()?)
    }

    /// Starts the runtime and its main node on a given network.
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
        let signals = SignalWatch::start(shared.shutdown.clone())?;
        shared.receive_buffer.warn_if_short();
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

    /// Node with the default name `default_name`, created at the first call.
    pub fn node(&self, default_name: &str) -> Result<Node, RuntimeError> {
        let mut nodes = lock(&self.nodes);
        if let Some((_, node)) = nodes.iter().find(|(name, _)| name == default_name) {
            return Ok(node.clone());
        }
        let node = node(&self.shared, &self.args, default_name)?;
        nodes.push((default_name.to_owned(), node.clone()));
        Ok(node)
    }

    /// Calls `callback` in every period of the steady clock, at least 1 ms, until shutdown or until
    /// the timer is dropped; never with a period of zero. The period can be changed.
    ///
    /// It runs on the io thread and must return at once. Missed periods are skipped.
    pub fn timer(&self, period: Duration, callback: impl FnMut() + Send + 'static) -> Timer {
        Timer::start(&self.shared.io, period, callback)
    }

    /// Timer as [`Runtime::timer`] that rests while nothing happens: after a period without a received message or
    /// request, a change of the graph, or [`Activity::note`](crate::Activity::note), the callback is called once a second, or in its own
    /// period if that is longer. Whatever happens ends the rest at once.
    pub fn resting_timer(
        &self,
        period: Duration,
        callback: impl FnMut() + Send + 'static,
    ) -> Timer {
        Timer::start_resting(
            &self.shared.io,
            period,
            self.shared.activity.clone(),
            callback,
        )
    }

    /// Handle to request shutdown.
    pub fn shutdown_handle(&self) -> Shutdown {
        self.shared.shutdown.clone()
    }

    /// Blocks until a shutdown request, then stops timers, sends queued messages, and leaves.
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

    /// Waits, for two seconds at most, until the handlers have processed all queued messages of this process.
    /// Not from a handler, callback or timer.
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
                // A full queue is counted and reported in the next message.
                let _ = publisher.publish(message);
            }
        });
        timer.detach();
        Ok(())
    }
}

/// Creates a node with its parameter services.
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
