//! Frames and topics of a log, from its first messages.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use lattice_bag::{BagReader, ReadOptions};
use lattice_core::pose::{TransformBuffer, TransformBufferOptions};
use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};
use lattice_msgs::geometry_msgs::{PoseStamped, PoseWithCovarianceStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::Imu;
use lattice_msgs::tf2_msgs::TFMessage;
use serde::de::DeserializeOwned;

use super::topics::TopicError;
use crate::cloud_input::CloudType;
use crate::convert::geometry;

/// Part of a log searched for frames of `/tf`, ns.
const TF_SPAN_NS: i64 = 10_000_000_000;
/// Limit of messages read per transform topic.
pub(super) const MAX_TF_MESSAGES: usize = 2000;
/// Distance from the origin at which single precision coordinates have a resolution of a millimetre, m.
const MAX_DISTANCE_M: f64 = 10_000.0;
/// Limit of frames in the tree.
const MAX_FRAMES: usize = 2000;

/// A topic of clouds or depth images, described by its first message.
pub(super) struct CloudTopic {
    pub topic: usize,
    /// `None`: depth images.
    pub cloud_type: Option<CloudType>,
    pub frame: String,
    pub labelled: bool,
}

/// A topic of poses or of a part of them, described by its first message.
pub(super) struct PoseTopic {
    pub topic: usize,
    /// Frame of the header.
    pub frame: String,
    /// `child_frame_id` of odometry; else empty.
    pub child: String,
    /// Reason why its first message gives no pose in a map, such as an Imu without orientation.
    pub unusable: Option<&'static str>,
}

/// Parents of frames, from all publishers.
#[derive(Default)]
pub(super) struct FrameTree {
    parents: BTreeMap<String, BTreeSet<(String, bool)>>,
    frames: BTreeSet<String>,
}

impl FrameTree {
    /// Reads the frames of transform topics.
    pub fn read(
        bag: &BagReader,
        topics: impl IntoIterator<Item = (usize, bool)>,
    ) -> Result<Self, TopicError> {
        let mut tree = Self::default();
        let start_ns = bag.start_ns().unwrap_or(0);
        for (topic, is_static) in topics {
            let Some(info) = bag.topics().get(topic) else {
                continue;
            };
            let options = ReadOptions {
                topics: Some(vec![info.name.clone()]),
                end_ns: (!is_static).then_some(start_ns.saturating_add(TF_SPAN_NS)),
                ..ReadOptions::default()
            };
            for message in bag.messages(&options)?.take(MAX_TF_MESSAGES) {
                let Ok(message) = cdr::from_slice::<TFMessage>(&message?.data) else {
                    continue;
                };
                for transform in &message.transforms {
                    let parent = bare(&transform.header.frame_id);
                    tree.add(&parent, &bare(&transform.child_frame_id), is_static);
                }
            }
        }
        Ok(tree)
    }

    fn add(&mut self, parent: &str, child: &str, is_static: bool) {
        if parent.is_empty() || child.is_empty() || self.frames.len() >= MAX_FRAMES {
            return;
        }
        self.frames.extend([parent.to_owned(), child.to_owned()]);
        let parents = self.parents.entry(child.to_owned()).or_default();
        parents.insert((parent.to_owned(), is_static));
    }

    pub fn contains(&self, frame: &str) -> bool {
        self.frames.contains(frame)
    }

    /// True if transforms connect two frames, or both are equal.
    pub fn connects(&self, a: &str, b: &str) -> bool {
        if a == b {
            return true;
        }
        let above = |frame: &str| self.above(frame, |_| true);
        let (of_a, of_b) = (above(a), above(b));
        of_a.contains(b) || of_b.contains(a) || !of_a.is_disjoint(&of_b)
    }

    /// True if `frame` is an ancestor of `base` through at least one dynamic transform: fixed in the world, as map
    /// and odom are.
    pub fn is_world_of(&self, frame: &str, base: &str) -> bool {
        let carried = self.above(base, |is_static| is_static);
        self.above(base, |_| true).contains(frame) && !carried.contains(frame) && frame != base
    }

    /// Root frame of this one.
    pub fn root(&self, frame: &str) -> String {
        let above = self.above(frame, |_| true);
        let root = above.iter().find(|f| !self.parents.contains_key(*f));
        root.cloned().unwrap_or_else(|| frame.to_owned())
    }

    /// Topmost ancestor through static transforms only.
    pub fn static_root(&self, frame: &str) -> String {
        let above = self.above(frame, |is_static| is_static);
        let is_top = |frame: &&String| {
            let parents = self.parents.get(*frame);
            !parents.is_some_and(|parents| parents.iter().any(|(_, is_static)| *is_static))
        };
        above
            .iter()
            .find(is_top)
            .cloned()
            .unwrap_or_else(|| frame.to_owned())
    }

    /// Ancestors of a frame through transforms of a kind, without itself.
    fn above(&self, frame: &str, kind: impl Fn(bool) -> bool) -> BTreeSet<String> {
        let mut seen = BTreeSet::new();
        let mut open = VecDeque::from([frame.to_owned()]);
        while let Some(frame) = open.pop_front() {
            for (parent, is_static) in self.parents.get(&frame).into_iter().flatten() {
                if kind(*is_static) && seen.insert(parent.clone()) {
                    open.push_back(parent.clone());
                }
            }
        }
        seen
    }
}

/// Cloud topics with messages.
pub(super) fn clouds(bag: &BagReader) -> Result<Vec<CloudTopic>, TopicError> {
    let mut clouds = Vec::new();
    for cloud_type in CloudType::ALL {
        for topic in topics_of(bag, cloud_type.name()) {
            let message = first_of(bag, topic, |data| cloud_type.decode(data))?;
            let Some(message) = message else { continue };
            clouds.push(CloudTopic {
                topic,
                cloud_type: Some(cloud_type),
                frame: bare(&message.header().frame_id),
                labelled: message.is_labelled(),
            });
        }
    }
    clouds.sort_by_key(|cloud| cloud.topic);
    Ok(clouds)
}

/// Topics of a pose type with messages.
pub(super) fn poses(bag: &BagReader, type_name: &str) -> Result<Vec<PoseTopic>, TopicError> {
    let mut poses = Vec::new();
    for topic in topics_of(bag, type_name) {
        let mut pose = PoseTopic {
            topic,
            frame: String::new(),
            child: String::new(),
            unusable: None,
        };
        // Geodetic poses have no frame in the log.
        match type_name {
            Odometry::TYPE => {
                if let Some(m) = first::<Odometry>(bag, topic)? {
                    (pose.frame, pose.child) = (bare(&m.header.frame_id), bare(&m.child_frame_id));
                    let at = m.pose.pose.position;
                    let is_far = at.x.hypot(at.y) > MAX_DISTANCE_M;
                    pose.unusable = is_far.then_some(
                        "its positions are over 10 km from the origin of their frame, as those of UTM are",
                    );
                }
            }
            PoseStamped::TYPE => {
                let message = first::<PoseStamped>(bag, topic)?;
                pose.frame = message.map_or(String::new(), |m| bare(&m.header.frame_id));
            }
            PoseWithCovarianceStamped::TYPE => {
                let message = first::<PoseWithCovarianceStamped>(bag, topic)?;
                pose.frame = message.map_or(String::new(), |m| bare(&m.header.frame_id));
            }
            Imu::TYPE => {
                let imu = first::<Imu>(bag, topic)?;
                let has_none = imu.is_some_and(|imu| imu.orientation_covariance[0] == -1.0);
                pose.unusable = has_none.then_some("it has no orientation");
            }
            _ => {}
        }
        poses.push(pose);
    }
    Ok(poses)
}

/// Largest distance between odometry positions and those of its frames by transforms at the same stamps, in
/// the first part of a log, m; 0 without such transforms.
pub(super) fn contradiction_m(
    bag: &BagReader,
    odometry: &PoseTopic,
    transforms: &[(usize, bool)],
) -> Result<f64, TopicError> {
    let end_ns = bag.start_ns().unwrap_or(0).saturating_add(TF_SPAN_NS);
    let of = |topic: usize| {
        let name = bag.topics().get(topic).map(|topic| topic.name.clone());
        bag.messages(&ReadOptions {
            topics: Some(name.into_iter().collect()),
            end_ns: Some(end_ns),
            ..ReadOptions::default()
        })
    };
    let mut buffer = TransformBuffer::new(TransformBufferOptions {
        history_s: f64::INFINITY,
        ..TransformBufferOptions::default()
    });
    for (topic, is_static) in transforms {
        for message in of(*topic)?.take(MAX_TF_MESSAGES) {
            let Ok(message) = cdr::from_slice::<TFMessage>(&message?.data) else {
                continue;
            };
            for transform in &message.transforms {
                if let Some(pose) = geometry::isometry_from_transform(&transform.transform) {
                    let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
                    let stamp_ns = transform.header.stamp.to_ns();
                    // An invalid transform is rejected during the replay.
                    let _ = buffer.insert(parent, child, stamp_ns, pose, *is_static);
                }
            }
        }
    }
    let mut longest_m: f64 = 0.0;
    for message in of(odometry.topic)?.take(MAX_TF_MESSAGES) {
        let Ok(message) = cdr::from_slice::<Odometry>(&message?.data) else {
            continue;
        };
        let stamp_ns = message.header.stamp.to_ns();
        let by_tf = buffer.lookup(&odometry.frame, &odometry.child, stamp_ns);
        if let (Ok(by_tf), Some(pose)) = (by_tf, geometry::isometry_from_pose(&message.pose.pose)) {
            let apart = by_tf.translation.vector - pose.translation.vector;
            longest_m = longest_m.max(apart.norm());
        }
    }
    Ok(longest_m)
}

/// Indices of the topics of a type with messages.
pub(super) fn topics_of<'a>(
    bag: &'a BagReader,
    type_name: &'a str,
) -> impl Iterator<Item = usize> + 'a {
    let topics = bag.topics().iter().enumerate();
    let of_type =
        topics.filter(move |(_, topic)| topic.type_name == type_name && topic.message_count > 0);
    of_type.map(|(i, _)| i)
}

/// First message of a topic, if it decodes.
pub(super) fn first<M: DeserializeOwned>(
    bag: &BagReader,
    topic: usize,
) -> Result<Option<M>, TopicError> {
    first_of(bag, topic, cdr::from_slice)
}

fn first_of<M>(
    bag: &BagReader,
    topic: usize,
    decode: impl Fn(&[u8]) -> Result<M, CdrError>,
) -> Result<Option<M>, TopicError> {
    let name = bag.topics().get(topic).map(|topic| topic.name.clone());
    let options = ReadOptions {
        topics: Some(name.into_iter().collect()),
        ..ReadOptions::default()
    };
    match bag.messages(&options)?.next() {
        Some(message) => Ok(decode(&message?.data).ok()),
        None => Ok(None),
    }
}

pub(super) fn bare(frame: &str) -> String {
    frame.trim_start_matches('/').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_world_are_above_the_machine_by_something_that_moves() {
        let mut tree = FrameTree::default();
        for (parent, child, is_static) in [
            ("map", "odom", false),
            ("odom", "base_footprint", false),
            ("base_footprint", "base_link", true),
            ("base_link", "laser", true),
            ("world", "other", false),
        ] {
            tree.add(parent, child, is_static);
        }
        assert!(tree.connects("map", "laser") && tree.connects("laser", "base_footprint"));
        assert!(!tree.connects("map", "other") && !tree.connects("nowhere", "map"));
        assert!(tree.connects("nowhere", "nowhere"));
        assert!(tree.is_world_of("odom", "base_link") && tree.is_world_of("map", "base_link"));
        assert!(!tree.is_world_of("base_footprint", "base_link"));
        assert!(!tree.is_world_of("laser", "base_link"));
        assert_eq!(tree.root("laser"), "map");
        assert_eq!(tree.static_root("laser"), "base_footprint");
        assert_eq!(tree.root("nowhere"), "nowhere");
    }
}
