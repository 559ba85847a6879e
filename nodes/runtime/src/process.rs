//! The runtime of a process: one participant, its threads, and the nodes on it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use smol::Timer;
use smol::channel::{Receiver, Sender, unbounded};
use smol::future;

use super::env::{Network, TransportKind};
use super::error::RuntimeError;
use super::logger_services;
use super::node::Node;
use super::param_services;
use super::qos::Qos;
use super::ros_args::RosArgs;
use super::rosout;
use super::security::Enclave;
use super::shared::{Shared, deadline};
use super::shutdown::{Shutdown, SignalWatch};
use super::type_description;

/// Between two messages on `/diagnostics`.
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

/// Shortest period of a timer.
const MIN_TIMER_PERIOD: Duration = Duration::from_millis(1);

/// Runs the nodes of a process. Dropping it closes the participant, and peers see it go at once.
///
/// SIGINT and SIGTERM ask for shutdown while it lives. Not to be dropped on one of its own threads.
pub struct Runtime {
    shared: Arc<Shared>,
    args: Arc<RosArgs>,
    main: Node,
    main_default_name: String,
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
        let name = args.enclave.clone().unwrap_or_else(|| "/".to_owned());
        let secrets = match &network.security {
            Some(security) => {
                security.secrets(&name, network.transport == TransportKind::Cyclone)?
            }
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
            main,
            main_default_name: default_node_name.to_owned(),
            _signals: signals,
            _rosout: None,
        };
        runtime.publish_diagnostics()?;
        if !runtime.args.no_rosout_logs {
            runtime._rosout = Some(runtime.publish_log()?);
        }
        Ok(runtime)
    }

    /// The node called `default_name` in the code; the main node if it is that.
    pub fn node(&self, default_name: &str) -> Result<Node, RuntimeError> {
        if default_name == self.main_default_name {
            return Ok(self.main.clone());
        }
        node(&self.shared, &self.args, default_name)
    }

    /// Calls `callback` in every period of the system's steady clock, 1 ms at least, until shutdown; never
    /// with a period of zero. The period can be changed by what is returned.
    ///
    /// It runs on the io thread and must return at once. Periods that were missed are left out.
    pub fn timer(&self, period: Duration, callback: impl FnMut() + Send + 'static) -> Period {
        let (sender, changes) = unbounded();
        if let Some(task) = self.shared.io.spawn(tick(period, changes, callback)) {
            task.detach();
        }
        Period(sender)
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
        let publisher = self
            .shared
            .publisher(self.main.id(), &topic, &Qos::ROSOUT)?;
        let (listener, records) = rosout::listen();
        if let Some(task) = self.shared.io.spawn(rosout::publish(records, publisher)) {
            task.detach();
        }
        Ok(listener)
    }

    fn publish_diagnostics(&self) -> Result<(), RuntimeError> {
        let topic = self.main.resolve("/diagnostics")?;
        let publisher =
            self.shared
                .publisher::<DiagnosticArray>(self.main.id(), &topic, &Qos::DIAGNOSTICS)?;
        let shared = Arc::downgrade(&self.shared);
        let (clock, fqn) = (self.main.clock(), self.main.fqn().to_owned());
        let _ = self.timer(DIAGNOSTICS_PERIOD, move || {
            if let Some(shared) = shared.upgrade() {
                let transport = shared.transport_status(&fqn);
                let message = shared.tasks.message(clock.now_ns(), transport);
                // A full queue is counted, and stated in the next message.
                let _ = publisher.publish(message);
            }
        });
        Ok(())
    }
}

/// The period of a timer. The timer goes on when it is dropped.
#[derive(Clone)]
pub struct Period(Sender<Duration>);

impl Period {
    /// Begins another period now; zero: none.
    pub fn set(&self, period: Duration) {
        // It ends with the runtime only.
        let _ = self.0.try_send(period);
    }
}

async fn tick(mut period: Duration, changes: Receiver<Duration>, mut callback: impl FnMut()) {
    let next = |at: Instant, period: Duration| match period.is_zero() {
        true => None,
        false => at.checked_add(period.max(MIN_TIMER_PERIOD)),
    };
    let mut due = next(Instant::now(), period);
    loop {
        let timer = async {
            match due {
                Some(at) => drop(Timer::at(at).await),
                None => future::pending().await,
            }
            None
        };
        let change = async {
            match changes.recv().await {
                Ok(period) => Some(period),
                Err(_) => future::pending().await,
            }
        };
        let now = Instant::now;
        due = match (future::or(change, timer).await, due) {
            (Some(changed), _) => {
                period = changed;
                next(now(), period)
            }
            (None, at) => {
                callback();
                at.and_then(|at| next(at, period))
                    .map(|next| next.max(now()))
            }
        };
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
