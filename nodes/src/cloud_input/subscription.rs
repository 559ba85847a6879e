//! Subscriptions to clouds, each of the type that is published on its topic.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lattice_msgs::RosMessage;
use lattice_msgs::sensor_msgs::{LaserScan, MultiEchoLaserScan, PointCloud, PointCloud2};
use lattice_msgs::{livox_interfaces, livox_ros_driver, livox_ros_driver2};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::Qos;
use lattice_runtime::{
    Activity, Losses, Node, RemotePublisher, Runtime, RuntimeError, Subscription,
    SubscriptionExecutor, Timer, lock,
};

use super::channels::cloud_of_channels;
use super::cloud_type::CloudType;
use super::error::CloudInputError;
use super::livox::cloud_of_livox;
use super::scan::{cloud_of_echoes, cloud_of_scan};
use crate::convert::cloud;
use crate::start::NodeError;

/// Period of checks of the published types.
const PERIOD: Duration = Duration::from_millis(200);
/// Time allowed for a publisher to appear.
const PATIENCE: Duration = Duration::from_secs(3);
/// Limit of changes of the type of a topic.
const MAX_CHANGES: u32 = 100;
/// Limit of other topics named in a warning.
const MAX_NAMED: usize = 8;

/// A cloud, or the reason for which a message was not converted.
pub type Converted = Result<Arc<PointCloud2>, CloudInputError>;

type HandOver = dyn Fn(&Arc<str>, Converted) + Send + Sync;

/// Size of a cloud in memory.
pub fn bytes_of(cloud: &Converted) -> usize {
    cloud.as_ref().map_or(0, |cloud| cloud::bytes_of(cloud))
}

/// Topics of clouds, with the counters and the handler of their messages.
pub struct SubscribedClouds {
    /// Names as in the parameters.
    pub topics: Vec<String>,
    /// Parameter that sets the topics, for the log.
    pub parameter: Option<&'static str>,
    /// Counts of losses that include these subscriptions.
    pub losses: Vec<Losses>,
    /// Receives each cloud with the name of its topic.
    pub hand_over: Box<HandOver>,
}

/// Subscriptions to clouds; dropping it ends them.
///
/// A topic has a subscription of PointCloud2 until a publisher of another [`CloudType`] is discovered on it.
#[must_use = "dropping it ends the subscriptions"]
pub struct CloudSubscriptions {
    _timer: Timer,
    inputs: Arc<Mutex<Inputs>>,
}

struct Inputs {
    node: Node,
    parameter: Option<&'static str>,
    losses: Vec<Losses>,
    hand_over: Arc<HandOver>,
    inputs: Vec<Input>,
    /// Noted while a type is changed.
    activity: Activity,
}

struct Input {
    name: Arc<str>,
    resolved: String,
    cloud_type: CloudType,
    /// `None` while the type is changed.
    subscription: Option<Subscription>,
    changes: u32,
    began: Instant,
    /// True once topics of other types were named.
    is_named: bool,
    warnings: Throttle,
}

impl CloudSubscriptions {
    /// Subscribes to the topics.
    pub fn start(runtime: &Runtime, node: &Node, of: SubscribedClouds) -> Result<Self, NodeError> {
        let mut inputs = Inputs {
            node: node.clone(),
            parameter: of.parameter,
            losses: of.losses,
            hand_over: of.hand_over.into(),
            inputs: Vec::new(),
            activity: node.activity(),
        };
        for topic in &of.topics {
            inputs.add(topic)?;
        }
        let inputs = Arc::new(Mutex::new(inputs));
        let checked = Arc::clone(&inputs);
        let timer = runtime.resting_timer(PERIOD, move || lock(&checked).follow_types());
        Ok(Self {
            _timer: timer,
            inputs,
        })
    }
}

impl Drop for CloudSubscriptions {
    /// Ends the subscriptions, also while the timer still holds them.
    fn drop(&mut self) {
        lock(&self.inputs).inputs.clear();
    }
}

impl Inputs {
    fn add(&mut self, topic: &str) -> Result<(), NodeError> {
        let name: Arc<str> = topic.into();
        let first = CloudType::PointCloud2;
        let (cloud_type, subscription) = match self.subscribe(&name, first) {
            // A publisher of this process came first.
            Err(RuntimeError::TypeMismatch { have, .. }) if CloudType::of(&have).is_some() => {
                let other = CloudType::of(&have).unwrap_or(first);
                (other, self.subscribe(&name, other)?)
            }
            subscription => (first, subscription?),
        };
        self.inputs.push(Input {
            resolved: self.node.resolve(topic)?,
            name,
            cloud_type,
            subscription: Some(subscription),
            changes: 0,
            began: Instant::now(),
            is_named: false,
            warnings: Throttle::new(Duration::from_secs(5)),
        });
        Ok(())
    }

    /// Subscribes anew where publishers have another type than the subscription.
    fn follow_types(&mut self) {
        let mut inputs = std::mem::take(&mut self.inputs);
        let publishers = match inputs.iter().any(Input::is_without_publisher) {
            true => self.node.remote_publishers(),
            false => Vec::new(),
        };
        for input in inputs.iter_mut().filter(|i| i.is_without_publisher()) {
            let here = publishers.iter().filter(|of| of.topic == input.resolved);
            let types: Vec<_> = here.filter_map(|of| CloudType::of(&of.type_name)).collect();
            let is_published = types.contains(&input.cloud_type);
            if let (Some(other), false) = (types.into_iter().min(), is_published)
                && input.changes < MAX_CHANGES
            {
                log::info!("{}: published as {}", input.resolved, other.name());
                input.cloud_type = other;
                input.subscription = None;
                input.changes += 1;
            }
            if input.subscription.is_some() {
                input.name_others(&publishers, self.parameter);
                continue;
            }
            match self.subscribe(&input.name, input.cloud_type) {
                Ok(subscription) => input.subscription = Some(subscription),
                // Until the subscription before has ended.
                Err(RuntimeError::TypeMismatch { .. }) => self.activity.note(),
                Err(error) => {
                    if input.warnings.check().is_some() {
                        log::warn!("{}: not subscribed: {error}", input.resolved);
                    }
                }
            }
        }
        self.inputs = inputs;
    }

    fn subscribe(&self, name: &Arc<str>, of: CloudType) -> Result<Subscription, RuntimeError> {
        let subscription = match of {
            CloudType::PointCloud2 => self.subscribe_as(name, Ok),
            CloudType::LivoxDriver2 => self
                .subscribe_as::<livox_ros_driver2::CustomMsg>(name, |m| {
                    converted(cloud_of_livox(&m))
                }),
            CloudType::LivoxDriver => self.subscribe_as::<livox_ros_driver::CustomMsg>(name, |m| {
                converted(cloud_of_livox(&Arc::unwrap_or_clone(m).into()))
            }),
            CloudType::LivoxInterfaces => self
                .subscribe_as::<livox_interfaces::CustomMsg>(name, |m| {
                    converted(cloud_of_livox(&Arc::unwrap_or_clone(m).into()))
                }),
            CloudType::PointCloud => {
                self.subscribe_as::<PointCloud>(name, |m| converted(cloud_of_channels(&m)))
            }
            CloudType::LaserScan => {
                self.subscribe_as::<LaserScan>(name, |m| converted(cloud_of_scan(&m)))
            }
            CloudType::MultiEchoLaserScan => {
                self.subscribe_as::<MultiEchoLaserScan>(name, |m| converted(cloud_of_echoes(&m)))
            }
        }?;
        let is_raw =
            |topic: &str| !topic.ends_with("/points_enu") && !topic.ends_with("/map_centers");
        (self.node).expect_publishers(
            [&subscription],
            "the sensor's driver",
            self.parameter,
            is_raw,
        );
        self.losses
            .iter()
            .for_each(|losses| losses.watch([&subscription]));
        Ok(subscription)
    }

    fn subscribe_as<M: RosMessage>(
        &self,
        name: &Arc<str>,
        convert: fn(Arc<M>) -> Converted,
    ) -> Result<Subscription, RuntimeError> {
        let (topic, hand_over) = (Arc::clone(name), Arc::clone(&self.hand_over));
        let handler = move |message| hand_over(&topic, convert(message));
        let executor = SubscriptionExecutor::Dedicated;
        self.node.subscribe(name, Qos::SCANS, executor, handler)
    }
}

impl Input {
    fn is_without_publisher(&self) -> bool {
        let subscription = self.subscription.as_ref();
        subscription.is_none_or(|subscription| subscription.publisher_count() == 0)
    }

    /// Warns once of topics of other types than PointCloud2, which are named elsewhere.
    fn name_others(&mut self, publishers: &[RemotePublisher], parameter: Option<&str>) {
        if self.is_named || self.began.elapsed() < PATIENCE {
            return;
        }
        let others = publishers.iter().filter(|of| {
            let cloud_type = CloudType::of(&of.type_name);
            cloud_type.is_some_and(|other| other != CloudType::PointCloud2)
        });
        let others: BTreeSet<String> = others
            .filter(|of| of.topic != self.resolved && of.topic.chars().all(is_of_name))
            .map(|of| format!("{} ({})", of.topic, of.type_name))
            .collect();
        if others.is_empty() {
            return;
        }
        self.is_named = true;
        let named: Vec<String> = others.into_iter().take(MAX_NAMED).collect();
        let set = parameter.map_or(String::new(), |parameter| format!(", or set {parameter}"));
        log::warn!(
            "no publisher on {}; of other types of clouds there are: {}; remap with -r {}:=TOPIC{set}",
            self.resolved,
            named.join(", "),
            self.name
        );
    }
}

fn is_of_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '/'
}

fn converted(cloud: Result<PointCloud2, CloudInputError>) -> Converted {
    cloud.map(Arc::new)
}
