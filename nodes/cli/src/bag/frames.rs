//! Frames named in the messages of a log.

use std::collections::{BTreeMap, BTreeSet};

use lattice_bag::{BagError, BagReader, ReadOptions, TopicInfo};
use lattice_msgs::cdr;
use lattice_msgs::tf2_msgs::TFMessage;

/// Limit of messages read of a log.
const MAX_MESSAGES: usize = 5000;
const MAX_BYTES: usize = 256 << 20;
/// Log time that is always read, so that `/tf` has sent most of its transforms, ns.
const MIN_SPAN_NS: i64 = 1_000_000_000;
/// Limit of transforms per topic.
const MAX_TRANSFORMS: usize = 200;

/// Frames of a topic, from its first messages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frames {
    /// `frame_id` of the header.
    pub frame_id: Option<String>,
    /// `child_frame_id` of an odometry.
    pub child_frame_id: Option<String>,
    /// Parent and child of the transforms.
    pub transforms: BTreeSet<[String; 2]>,
}

/// Frame fields of a message type.
#[derive(Clone, Copy, PartialEq)]
enum Content {
    Transforms,
    Header,
    Odometry,
}

/// Frames of each topic by its index, for topics whose first messages name some.
pub fn of_log(reader: &BagReader) -> Result<BTreeMap<usize, Frames>, BagError> {
    let content: Vec<_> = reader.topics().iter().map(content).collect();
    let topics = reader.topics().iter().zip(&content);
    let wanted = topics.filter(|(topic, content)| content.is_some() && topic.message_count > 0);
    let names: Vec<_> = wanted.map(|(topic, _)| topic.name.clone()).collect();
    let mut frames: BTreeMap<usize, Frames> = BTreeMap::new();
    if names.is_empty() {
        return Ok(frames);
    }
    let options = ReadOptions {
        topics: Some(names.clone()),
        ..ReadOptions::default()
    };
    let (mut bytes, mut begin_ns) = (0_usize, None);
    for message in reader.messages(&options)?.take(MAX_MESSAGES) {
        // Messages before damage are used; the log's reader warns of it.
        let Ok(message) = message else {
            break;
        };
        bytes = bytes.saturating_add(message.data.len());
        let begin_ns = *begin_ns.get_or_insert(message.log_time_ns);
        let is_late = message.log_time_ns.saturating_sub(begin_ns) > MIN_SPAN_NS;
        if bytes > MAX_BYTES || is_late && frames.len() >= names.len() {
            break;
        }
        if let Some(Some(content)) = content.get(message.topic) {
            let known = frames.entry(message.topic).or_default();
            known.add(*content, &message.data);
        }
    }
    Ok(frames)
}

impl Frames {
    /// Adds the frames of a message; a damaged one adds none.
    fn add(&mut self, content: Content, message: &[u8]) {
        if content == Content::Transforms {
            let edges = cdr::from_slice::<TFMessage>(message).unwrap_or_default();
            for edge in edges.transforms {
                if self.transforms.len() < MAX_TRANSFORMS {
                    let ends = [edge.header.frame_id, edge.child_frame_id];
                    self.transforms.insert(ends);
                }
            }
        } else if self.frame_id.is_none() {
            let mut prefix = Prefix::new(message);
            self.frame_id = prefix.header();
            if content == Content::Odometry {
                self.child_frame_id = prefix.text();
            }
        }
    }
}

/// Frame fields of a message type; `None` for images, which are numerous.
fn content(topic: &TopicInfo) -> Option<Content> {
    match topic.type_name.as_str() {
        "tf2_msgs/msg/TFMessage" => return Some(Content::Transforms),
        "nav_msgs/msg/Odometry" => return Some(Content::Odometry),
        "sensor_msgs/msg/Image" | "sensor_msgs/msg/CompressedImage" => return None,
        _ => {}
    }
    let ours = lattice_msgs::definition_of(&topic.type_name);
    let definition = topic.definition.as_deref().or(ours.as_deref())?;
    let mut lines = definition
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default());
    // Constants are not fields.
    let first = lines.find(|line| !line.trim().is_empty() && !line.contains('='))?;
    let of = first.split_whitespace().next();
    matches!(
        of,
        Some("std_msgs/Header" | "std_msgs/msg/Header" | "Header")
    )
    .then_some(Content::Header)
}

/// First fields of a CDR message.
struct Prefix<'a> {
    body: &'a [u8],
    at: usize,
    is_big: bool,
}

impl<'a> Prefix<'a> {
    fn new(message: &'a [u8]) -> Self {
        Self {
            body: message.get(4..).unwrap_or_default(),
            at: 0,
            is_big: message.get(1) == Some(&0),
        }
    }

    /// Reads the `frame_id` of a header, after its stamp.
    fn header(&mut self) -> Option<String> {
        self.at = 8;
        self.text()
    }

    fn text(&mut self) -> Option<String> {
        let start = self.at.checked_next_multiple_of(4)?;
        let length = *self.body.get(start..)?.first_chunk()?;
        let length = match self.is_big {
            true => u32::from_be_bytes(length),
            false => u32::from_le_bytes(length),
        };
        let end = start.checked_add(4)?.checked_add(length as usize)?;
        let text = self.body.get(start + 4..end)?;
        self.at = end;
        let text = text.strip_suffix(&[0]).unwrap_or(text);
        Some(String::from_utf8_lossy(text).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use lattice_msgs::geometry_msgs::TransformStamped;
    use lattice_msgs::nav_msgs::Odometry;
    use lattice_msgs::sensor_msgs::PointCloud2;

    use super::*;

    #[test]
    fn frames_of_headers_odometry_and_transforms_are_read() {
        let mut cloud = PointCloud2::default();
        cloud.header.frame_id = "os_lidar".into();
        let mut odometry = Odometry::default();
        odometry.header.frame_id = "odom".into();
        odometry.child_frame_id = "base_link".into();
        let mut edge = TransformStamped::default();
        edge.header.frame_id = "odom".into();
        edge.child_frame_id = "base_link".into();
        let tf = TFMessage {
            transforms: vec![edge.clone(), edge],
        };
        let read = |content, message: Vec<u8>| {
            let mut frames = Frames::default();
            frames.add(content, &message);
            for length in 0..message.len() {
                Frames::default().add(content, &message[..length]);
            }
            frames
        };
        let frames = read(Content::Header, cdr::to_vec(&cloud).unwrap());
        assert_eq!(frames.frame_id.as_deref(), Some("os_lidar"));
        let frames = read(Content::Odometry, cdr::to_vec(&odometry).unwrap());
        assert_eq!(frames.frame_id.as_deref(), Some("odom"));
        assert_eq!(frames.child_frame_id.as_deref(), Some("base_link"));
        let frames = read(Content::Transforms, cdr::to_vec(&tf).unwrap());
        let edge = ["odom", "base_link"].map(str::to_owned);
        assert_eq!(frames.transforms, BTreeSet::from([edge]));
        // A length beyond the message.
        let lie = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255, 65];
        assert_eq!(read(Content::Header, lie.to_vec()), Frames::default());
    }

    #[test]
    fn types_that_begin_with_a_header_are_known_by_their_definition() {
        let topic = |type_name: &str, definition: Option<&str>| TopicInfo {
            type_name: type_name.into(),
            definition: definition.map(str::to_owned),
            ..TopicInfo::default()
        };
        let is_header = |topic| content(&topic) == Some(Content::Header);
        assert!(is_header(topic("sensor_msgs/msg/PointCloud2", None)));
        let own = "# ours\n\nuint8 A=0\nstd_msgs/Header header # b = c\nfloat32 x\n";
        assert!(is_header(topic("my_msgs/msg/Thing", Some(own))));
        assert!(!is_header(topic("std_msgs/msg/String", None)));
        assert!(!is_header(topic("my_msgs/msg/Thing", None)));
        assert!(!is_header(topic("sensor_msgs/msg/Image", None)));
    }
}
