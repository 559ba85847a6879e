//! Stamps and transforms of the messages of other nodes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};
use std::time::{SystemTime, UNIX_EPOCH};

use lattice_msgs::rosgraph_msgs::Clock;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::qos::Qos;
use lattice_runtime::{GraphRole, Node, RuntimeError, Subscription, SubscriptionExecutor, lock};

use super::facts::{Endpoint, Frame, Stamps, TimeFacts};

/// Types that begin with a stamp, and are not as large as images.
const STAMPED: [&str; 10] = [
    "diagnostic_msgs/msg/DiagnosticArray",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TwistStamped",
    "nav_msgs/msg/Odometry",
    "rcl_interfaces/msg/Log",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/PointCloud2",
];

/// Limits of topics and frames.
const MAX_TOPICS: usize = 100;
const MAX_FRAMES: usize = 10_000;

/// Subscriptions to `/clock`, `/tf`, `/tf_static` and topics with stamps.
pub struct Messages {
    received: Arc<Mutex<Received>>,
    _subscriptions: Vec<Subscription>,
}

#[derive(Default)]
struct Received {
    /// `/clock` minus the system clock, ns.
    simulated_ns: Option<i64>,
    /// Stamp minus system time of the last message, ns.
    offsets_ns: BTreeMap<String, i64>,
    frames: BTreeMap<String, Known>,
}

#[derive(Default)]
struct Known {
    parents: BTreeSet<String>,
    newest_ns: Option<i64>,
}

impl Messages {
    /// Subscribes to the topics of these endpoints.
    pub fn subscribe(node: &Node, endpoints: &[Endpoint]) -> Result<Self, RuntimeError> {
        let received = Arc::new(Mutex::new(Received::default()));
        let shared = SubscriptionExecutor::Shared;
        let of = Arc::clone(&received);
        let on_clock = move |message: Arc<Clock>| {
            let ahead = message.clock.to_ns().saturating_sub(now_ns());
            lock(&of).simulated_ns = Some(ahead);
        };
        let mut subscriptions = vec![node.subscribe("/clock", Qos::CLOCK, shared, on_clock)?];
        for (topic, qos, is_static) in [
            ("/tf", Qos::best_effort(100), false),
            ("/tf_static", Qos::TF_STATIC_LISTENER, true),
        ] {
            let of = Arc::clone(&received);
            let on_transforms = move |message: Arc<TFMessage>| {
                lock(&of).transforms(&message, is_static);
            };
            subscriptions.push(node.subscribe(topic, qos, shared, on_transforms)?);
        }
        for (topic, type_name) in stamped(endpoints) {
            let (of, name) = (Arc::clone(&received), topic.to_owned());
            let on_message = move |message: Vec<u8>| {
                if let Some(stamp) = stamp_ns(&message) {
                    let offset = stamp.saturating_sub(now_ns());
                    lock(&of).offsets_ns.insert(name.clone(), offset);
                }
            };
            let qos = Qos::best_effort(5);
            subscriptions.push(node.subscribe_raw(topic, type_name, qos, shared, on_message)?);
        }
        Ok(Self {
            received,
            _subscriptions: subscriptions,
        })
    }

    /// Messages received so far.
    pub fn facts(&self) -> TimeFacts {
        let received = lock(&self.received);
        let simulated_ns = received.simulated_ns.unwrap_or(0);
        let seconds = |offset_ns: i64| offset_ns as f64 * 1e-9;
        let (stamp, frame) = (
            |(topic, offset_ns): (&String, &i64)| Stamps {
                topic: topic.clone(),
                offset_s: seconds(offset_ns.saturating_sub(simulated_ns)),
            },
            |(child, known): (&String, &Known)| {
                let now = now_ns().saturating_add(simulated_ns);
                Frame {
                    child: child.clone(),
                    parents: known.parents.clone(),
                    offset_s: known.newest_ns.map(|ns| seconds(ns.saturating_sub(now))),
                }
            },
        );
        TimeFacts {
            simulated_s: received.simulated_ns.map(seconds),
            stamps: received.offsets_ns.iter().map(stamp).collect(),
            frames: received.frames.iter().map(frame).collect(),
        }
    }
}

impl Received {
    fn transforms(&mut self, message: &TFMessage, is_static: bool) {
        for transform in &message.transforms {
            let name = |frame: &str| frame.trim_start_matches('/').to_owned();
            let child = name(&transform.child_frame_id);
            if self.frames.len() >= MAX_FRAMES && !self.frames.contains_key(&child) {
                continue;
            }
            let known = self.frames.entry(child).or_default();
            if known.parents.len() < MAX_TOPICS {
                known.parents.insert(name(&transform.header.frame_id));
            }
            if !is_static {
                let stamp = transform.header.stamp.to_ns();
                known.newest_ns = Some(known.newest_ns.map_or(stamp, |ns| ns.max(stamp)));
            }
        }
    }
}

/// Topics with stamps and their types, each once.
fn stamped(endpoints: &[Endpoint]) -> BTreeMap<&str, &str> {
    let mut found = BTreeMap::new();
    for of in endpoints
        .iter()
        .filter(|of| of.role == GraphRole::Publisher)
    {
        let type_name = of.type_name.as_deref().unwrap_or_default();
        if STAMPED.contains(&type_name) && found.len() < MAX_TOPICS {
            found.entry(of.topic.as_str()).or_insert(type_name);
        }
    }
    found
}

/// Stamp of a message that begins with one, ns; `None` if it is not set.
fn stamp_ns(message: &[u8]) -> Option<i64> {
    let word = |at: usize| message.get(at..at + 4)?.first_chunk::<4>().copied();
    let (seconds, nanoseconds) = match message.get(1)? & 1 {
        0 => (i32::from_be_bytes(word(4)?), u32::from_be_bytes(word(8)?)),
        _ => (i32::from_le_bytes(word(4)?), u32::from_le_bytes(word(8)?)),
    };
    let stamp = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
    (stamp != 0).then_some(stamp)
}

/// Time of this machine, ns since 1970.
fn now_ns() -> i64 {
    let elapsed = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(elapsed.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use lattice_msgs::RosMessage;
    use lattice_msgs::cdr;
    use lattice_msgs::nav_msgs::Odometry;

    use super::*;

    #[test]
    fn the_stamp_is_the_first_field() {
        let mut message = Odometry::default();
        message.header.stamp.sec = 7;
        message.header.stamp.nanosec = 5;
        assert!(STAMPED.contains(&Odometry::TYPE));
        let bytes = cdr::to_vec(&message).unwrap();
        assert_eq!(stamp_ns(&bytes), Some(7_000_000_005));
        let big = [0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 5];
        assert_eq!(stamp_ns(&big), Some(7_000_000_005));
        assert_eq!(stamp_ns(&bytes[..11]), None);
        assert_eq!(stamp_ns(&[0; 12]), None);
    }
}
