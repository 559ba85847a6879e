//! Topics besides the map, subscribed to on demand.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use lattice_msgs::cdr::CdrError;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::{CalibrationResult, LatticeMap};
use lattice_msgs::nav_msgs::Path;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_msgs::visualization_msgs::MarkerArray;
use lattice_msgs::{RosMessage, cdr};
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, RuntimeError, Subscription, SubscriptionExecutor};

use super::broadcast::{Broadcaster, Class, Demand};
use super::options::ViewerOptions;
use crate::compute::Inbox;

/// Largest forwarded message, bytes.
const MAX_MESSAGE_BYTES: usize = 8 << 20;
/// Limit of frames with stored static transforms.
const MAX_STATIC_FRAMES: usize = 10_000;

/// Deferred serialization of a channel message to CDR.
pub type Unwritten = Box<dyn FnOnce() -> Result<Vec<u8>, CdrError> + Send>;

/// Creates the subscription of a channel.
type Subscribe = Box<dyn Fn() -> Result<Subscription, RuntimeError> + Send>;

/// Event for the compute thread.
pub trait FromChannel: Send + 'static {
    /// A message of a channel.
    fn message(channel: u32, message: Unwritten) -> Self;
}

/// Subscription policy of a channel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    /// Always: small messages that late joiners need.
    Always,
    /// While a client subscribes.
    OnDemand,
    /// Renewed for each client, so that the publisher sends its latched messages again.
    EachAnew,
}

struct Source {
    channel: u32,
    when: When,
    subscribe: Subscribe,
    subscription: Option<Subscription>,
    joined: u64,
}

/// Topics besides the map.
pub struct Sources {
    sources: Vec<Source>,
    /// Messages rejected by the inbox, or too long.
    pub lost: Arc<AtomicU64>,
}

/// Adds sources to a broadcaster.
struct Builder<'a, E> {
    node: &'a Node,
    broadcaster: &'a Broadcaster,
    inbox: &'a Inbox<E>,
    sources: Sources,
}

impl<E: FromChannel> Builder<'_, E> {
    fn add<M: RosMessage>(
        &mut self,
        topic: &str,
        (qos, executor): (Qos, SubscriptionExecutor),
        depth: usize,
        when: When,
    ) -> Result<(), RuntimeError> {
        let kept = when != When::EachAnew && qos.durability == Qos::LATCHED.durability;
        let full = self.node.resolve(topic)?;
        let channel = self
            .broadcaster
            .channel::<M>(&full, Class::Newest { depth }, kept);
        let (node, inbox) = (self.node.clone(), self.inbox.clone());
        let (topic, lost) = (topic.to_owned(), Arc::clone(&self.sources.lost));
        self.sources.sources.push(Source {
            channel,
            when,
            subscribe: Box::new(move || {
                let (inbox, lost) = (inbox.clone(), Arc::clone(&lost));
                node.subscribe_undecoded::<M>(&topic, qos, executor, move |message| {
                    let bytes = message.bytes(|_| 4096);
                    let event = E::message(channel, Box::new(move || message.into_cdr()));
                    let fits = bytes <= MAX_MESSAGE_BYTES && inbox.send(event, bytes);
                    lost.fetch_add(u64::from(!fits), Ordering::Relaxed);
                })
            }),
            subscription: None,
            joined: 0,
        });
        Ok(())
    }
}

impl Sources {
    /// Adds the channels of all topics to a broadcaster.
    pub fn new<E: FromChannel>(
        node: &Node,
        broadcaster: &Broadcaster,
        options: &ViewerOptions,
        inbox: &Inbox<E>,
    ) -> Result<Self, RuntimeError> {
        let sources = Sources {
            sources: Vec::new(),
            lost: Arc::default(),
        };
        let mut builder = Builder {
            node,
            broadcaster,
            inbox,
            sources,
        };
        let shared = |qos| (qos, SubscriptionExecutor::Shared);
        let dedicated = |qos| (qos, SubscriptionExecutor::Dedicated);
        builder.add::<TFMessage>("/tf", shared(Qos::TF), 100, When::Always)?;
        builder.add::<DiagnosticArray>(
            "/diagnostics",
            shared(Qos::DIAGNOSTICS),
            20,
            When::Always,
        )?;
        builder.add::<CalibrationResult>("calibration", shared(Qos::LATCHED), 1, When::Always)?;
        builder.add::<LabelInfo>("label_info", shared(Qos::LATCHED), 1, When::Always)?;
        // Of lidar odometry, whose loops move the whole path.
        builder.add::<Path>("path", shared(Qos::LATCHED), 1, When::OnDemand)?;
        builder.add::<MarkerArray>("loop_closures", shared(Qos::LATCHED), 1, When::OnDemand)?;
        builder.add::<PointCloud2>("map_centers", dedicated(Qos::MARKERS), 1, When::OnDemand)?;
        builder.add::<MarkerArray>(
            "voxel_markers",
            dedicated(Qos::MARKERS),
            1000,
            When::EachAnew,
        )?;
        builder.add::<LatticeMap>("free", dedicated(Qos::MAP), 1000, When::EachAnew)?;
        for topic in &options.cloud_topics {
            builder.add::<PointCloud2>(topic, dedicated(Qos::SCANS), 20, When::OnDemand)?;
        }
        Ok(builder.sources)
    }

    /// Creates and drops subscriptions by demand.
    pub fn adapt(&mut self, broadcaster: &Broadcaster) {
        for source in &mut self.sources {
            let Demand { clients, joined } = broadcaster.demand(source.channel);
            let wanted = clients > 0 || source.when == When::Always;
            let anew = source.when == When::EachAnew && joined != source.joined;
            if !wanted || anew {
                source.subscription = None;
            }
            source.joined = joined;
            if wanted && source.subscription.is_none() {
                match (source.subscribe)() {
                    Ok(subscription) => source.subscription = Some(subscription),
                    Err(error) => log::debug!("not subscribed: {error}"),
                }
            }
        }
    }

    /// Ends all subscriptions.
    pub fn end(&mut self) {
        self.sources.clear();
    }
}

/// Static transforms of all publishers as one message.
#[derive(Default)]
pub struct FixedTransforms(BTreeMap<String, TransformStamped>);

impl FixedTransforms {
    /// Adds the transforms of a message; returns the merged message.
    pub fn add(&mut self, message: &TFMessage) -> Result<Vec<u8>, CdrError> {
        for transform in &message.transforms {
            let child = &transform.child_frame_id;
            if self.0.len() < MAX_STATIC_FRAMES || self.0.contains_key(child) {
                self.0.insert(child.clone(), transform.clone());
            }
        }
        cdr::to_vec(&TFMessage {
            transforms: self.0.values().cloned().collect(),
        })
    }
}
