//! A logical node: name, parameters, remap rules and endpoints.

use std::sync::Arc;

use lattice_msgs::RosMessage;

use super::clock::Clock;
use super::diagnostics::Diagnostics;
use super::expected::{Expected, Source, Watch};
use super::shared::{DEFAULT_MAX_MESSAGE_BYTES, Shared};
use crate::activity::Activity;
use crate::communication::lifecycle_gate::LifecycleGate;
use crate::communication::publisher::{Publisher, RawPublisher};
use crate::communication::subscription::{
    Sample, Stats, Subscription, SubscriptionExecutor, Undecoded,
};
use crate::config::names::{self, NameKind};
use crate::config::params::Params;
use crate::config::ros_args::RosArgs;
use crate::error::RuntimeError;
use crate::graph::discovered_graph::{GraphEndpoint, RemoteEndpoint};
use crate::graph::local_graph::NodeId;
use crate::transport::outbox::WhenFull;
use crate::transport::qos::{Durability, Qos};
use crate::transport::remote::RemotePublisher;

/// Smallest `max_message_bytes`: an Odometry has 720 bytes, so a smaller limit would reject poses.
const MIN_MESSAGE_BYTES: usize = 1000;

/// A node of the process. Clones refer to the same node.
#[derive(Clone)]
pub struct Node {
    inner: Arc<Inner>,
}

struct Inner {
    shared: Arc<Shared>,
    args: Arc<RosArgs>,
    name: String,
    namespace: String,
    fqn: String,
    id: NodeId,
    params: Arc<Params>,
    clock: Clock,
    max_message_bytes: usize,
    gate: Arc<LifecycleGate>,
    expected: Arc<Expected>,
}

impl Node {
    pub(crate) fn new(
        shared: &Arc<Shared>,
        args: &Arc<RosArgs>,
        default_name: &str,
    ) -> Result<Self, RuntimeError> {
        let name = args.node_name(default_name);
        let namespace = args.namespace(default_name);
        names::validate_node_name(&name)?;
        names::validate_namespace(&namespace)?;
        let fqn = names::fully_qualified(&name, &namespace);
        let params = Arc::new(Params::load_renamed(args, &fqn, default_name)?);
        let max_message_bytes = params.usize_in(
            "max_message_bytes",
            DEFAULT_MAX_MESSAGE_BYTES,
            MIN_MESSAGE_BYTES..=u32::MAX as usize,
        )?;
        let id = shared.add_node(&namespace, &name)?;
        let clock = Clock::default();
        let topic = names::resolve(NameKind::Topic, "/clock", &name, &namespace, &args.remaps)?;
        follow_use_sim_time(shared, id, topic, &params, &clock)?;
        let inner = Inner {
            shared: Arc::clone(shared),
            args: Arc::clone(args),
            name,
            namespace,
            fqn,
            id,
            params,
            clock,
            max_message_bytes,
            gate: Arc::default(),
            expected: Arc::default(),
        };
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    pub(crate) fn shared(&self) -> &Arc<Shared> {
        &self.inner.shared
    }

    pub(crate) fn id(&self) -> NodeId {
        self.inner.id
    }

    /// Lifecycle gate of its topics.
    pub(crate) fn gate(&self) -> &LifecycleGate {
        &self.inner.gate
    }

    /// Name without namespace.
    pub fn name(&self) -> &str {
        &self.inner.name
    }

    /// Full name, such as `/robot/mapper`.
    pub(crate) fn fqn(&self) -> &str {
        &self.inner.fqn
    }

    /// Parameters.
    pub fn params(&self) -> &Arc<Params> {
        &self.inner.params
    }

    /// Full name of a topic, remapped.
    pub fn resolve(&self, topic: &str) -> Result<String, RuntimeError> {
        self.full_name(NameKind::Topic, topic)
    }

    pub(crate) fn full_name(&self, kind: NameKind, name: &str) -> Result<String, RuntimeError> {
        let Inner {
            name: node,
            namespace,
            args,
            ..
        } = &*self.inner;
        let remaps = &args.remaps;
        Ok(names::resolve(kind, name, node, namespace, remaps)?)
    }

    /// Clock of the node.
    pub fn clock(&self) -> Clock {
        self.inner.clock.clone()
    }

    /// Diagnostic tasks of the node, for `/diagnostics`.
    pub fn diagnostics(&self) -> Diagnostics {
        let shared = Arc::downgrade(&self.inner.shared);
        let losses = move || {
            let shared = shared.upgrade();
            shared.map_or_else(Vec::new, |shared| shared.losses())
        };
        Diagnostics::new(&self.inner.fqn, &self.inner.shared.tasks, Arc::new(losses))
    }

    /// Creates a publisher; the parameters `qos.<topic>.*` override the QoS.
    pub fn publisher<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
    ) -> Result<Publisher<M>, RuntimeError> {
        self.publisher_when_full(topic, qos, WhenFull::Drop)
    }

    /// Creates a publisher that drops nothing for a slow reliable subscriber: messages wait in its
    /// bounded queue, so publish only while [`Publisher::is_acknowledged`].
    pub fn lossless_publisher<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
    ) -> Result<Publisher<M>, RuntimeError> {
        self.publisher_when_full(topic, qos, WhenFull::Wait)
    }

    fn publisher_when_full<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
        when_full: WhenFull,
    ) -> Result<Publisher<M>, RuntimeError> {
        let resolved = self.resolve(topic)?;
        let qos = qos.with_overrides(&self.inner.params, &resolved, topic)?;
        let shared = &self.inner.shared;
        let mut publisher = shared.publisher(self.id(), &resolved, &qos, when_full)?;
        self.inner.gate.watch(&publisher.parts.peers);
        publisher.gate = Some(Arc::clone(&self.inner.gate));
        Ok(publisher)
    }

    /// Creates a publisher with exactly this QoS.
    pub(crate) fn publisher_as_is<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
    ) -> Result<Publisher<M>, RuntimeError> {
        let resolved = self.resolve(topic)?;
        let shared = &self.inner.shared;
        shared.publisher(self.id(), &resolved, &qos, WhenFull::Drop)
    }

    /// Creates a publisher of CDR bytes of a type such as `sensor_msgs/msg/Imu`, on a full topic name.
    ///
    /// Announces `type_hash` (`RIHS01_...`) if valid, else the hash of our message of this type.
    pub fn raw_publisher(
        &self,
        resolved_topic: &str,
        type_name: &str,
        type_hash: Option<&str>,
        qos: Qos,
    ) -> Result<RawPublisher, RuntimeError> {
        names::validate_full_name(resolved_topic)?;
        self.inner
            .shared
            .raw_publisher(self.id(), resolved_topic, type_name, type_hash, &qos)
    }

    /// Subscribes to a topic; `qos.<topic>.*` override the QoS.
    ///
    /// The handler runs on a thread of the runtime and must return at once. It may publish; it must not
    /// flush, publish raw messages or end the runtime.
    pub fn subscribe<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
        executor: SubscriptionExecutor,
        mut handler: impl FnMut(Arc<M>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        self.subscribe_samples(topic, qos, executor, move |sample, stats| {
            if let Some(message) = stats.decode(sample) {
                handler(message);
            }
        })
    }

    /// Subscribes with a handler that receives undecoded messages; otherwise as [`Node::subscribe`]. For large
    /// messages that one thread must keep in order.
    pub fn subscribe_undecoded<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
        executor: SubscriptionExecutor,
        mut handler: impl FnMut(Undecoded<M>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        self.subscribe_samples(topic, qos, executor, move |sample, stats| {
            handler(Undecoded::new(sample, stats));
        })
    }

    /// Subscribes to a full topic name of any type in other processes; the handler receives CDR bytes,
    /// encapsulation header first. Its restrictions are those of [`Node::subscribe`].
    pub fn subscribe_raw(
        &self,
        resolved_topic: &str,
        type_name: &str,
        qos: Qos,
        executor: SubscriptionExecutor,
        handler: impl FnMut(Vec<u8>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        names::validate_full_name(resolved_topic)?;
        let (of, max) = ((resolved_topic, type_name), self.inner.max_message_bytes);
        self.inner
            .shared
            .subscribe_raw(self.id(), of, &qos, executor, max, handler)
    }

    /// Activity of the process, see [`Runtime::resting_timer`](crate::Runtime::resting_timer).
    pub fn activity(&self) -> Activity {
        self.inner.shared.activity.clone()
    }

    /// Known publishers of other processes, on any topic.
    pub fn remote_publishers(&self) -> Vec<RemotePublisher> {
        self.inner.shared.remote_publishers()
    }

    /// Known publishers, subscriptions and servers of the nodes of all processes. Node names of other processes
    /// arrive soon after the first call.
    pub fn graph(&self) -> Vec<GraphEndpoint> {
        self.inner.shared.graph_of_all()
    }

    /// Known publishers, subscriptions and servers of other processes with their types and QoS. Node names arrive
    /// soon after the first call.
    pub fn remote_endpoints(&self) -> Vec<RemoteEndpoint> {
        self.inner.shared.remote_endpoints()
    }

    /// Reports each of these topics that has no publisher 3 s from now: once in the log, again when alternative
    /// topics appear, and in the task `inputs` of `/diagnostics` while it has none.
    ///
    /// The message names alternative topics of the same type for which `is_like` holds. `from` names the
    /// publisher of the topic, `parameter` the parameter that sets it.
    pub fn expect_publishers<'a>(
        &self,
        subscriptions: impl IntoIterator<Item = &'a Subscription>,
        from: &'static str,
        parameter: Option<&'static str>,
        is_like: fn(&str) -> bool,
    ) {
        let source = Source {
            from,
            parameter,
            is_like,
        };
        if self.inner.expected.add(subscriptions, source) {
            let watch = Watch {
                expected: Arc::clone(&self.inner.expected),
                shared: Arc::downgrade(&self.inner.shared),
                diagnostics: self.diagnostics(),
                namespace: self.inner.namespace.clone(),
            };
            watch.start(&self.inner.shared.io);
        }
    }

    fn subscribe_samples<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
        executor: SubscriptionExecutor,
        mut handler: impl FnMut(Sample<'_, M>, &Arc<Stats>) + Send + 'static,
    ) -> Result<Subscription, RuntimeError> {
        let resolved = self.resolve(topic)?;
        let qos = qos.with_overrides(&self.inner.params, &resolved, topic)?;
        let max = self.inner.max_message_bytes;
        let gate = Arc::clone(&self.inner.gate);
        // Latched samples are sent once: an inactive node that dropped them would never receive them.
        let latched = qos.durability == Durability::TransientLocal;
        let handler = move |sample: Sample<'_, M>, stats: &Arc<Stats>| {
            if latched || gate.is_open() {
                handler(sample, stats);
            }
        };
        self.inner
            .shared
            .subscribe(self.id(), &resolved, &qos, executor, max, handler)
    }
}

/// Switches a clock to simulated time while the parameter `use_sim_time` is true.
fn follow_use_sim_time(
    shared: &Arc<Shared>,
    node: NodeId,
    topic: String,
    params: &Params,
    clock: &Clock,
) -> Result<(), RuntimeError> {
    let (weak, changed) = (Arc::downgrade(shared), clock.clone());
    let set = move |clock: &Clock, params: &Params| -> Result<(), RuntimeError> {
        match (params.bool("use_sim_time", false)?, weak.upgrade()) {
            (true, Some(shared)) => clock.simulate(shared.sim_clock(node, &topic)?),
            _ => clock.follow_system(),
        }
        Ok(())
    };
    set(clock, params)?;
    params.also_apply(move |params| set(&changed, params).map_err(|error| error.to_string()));
    Ok(())
}
