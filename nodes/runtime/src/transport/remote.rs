//! Discovered endpoints of other processes.

use super::qos::{Durability, Reliability};

/// Longest name of a topic or type, bytes.
const MAX_NAME_BYTES: usize = 512;

/// Role of an endpoint in the ROS graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum GraphRole {
    /// Publishes a topic.
    Publisher,
    /// Subscribes to a topic.
    Subscriber,
    /// Serves a service.
    Server,
}

/// Type and QoS of a publisher or subscription, as announced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Announced {
    /// Type, such as `tf2_msgs/msg/TFMessage`.
    pub type_name: String,
    /// Type hash (`RIHS01_...`), if announced.
    pub type_hash: Option<String>,
    /// Offered or requested reliability.
    pub reliability: Reliability,
    /// Offered or requested durability.
    pub durability: Durability,
}

impl Announced {
    /// Type and QoS of an endpoint; `None` if the type is not a ROS type.
    pub(crate) fn of(
        dds_type: &str,
        hash: Option<&str>,
        (reliability, durability): (Reliability, Durability),
    ) -> Option<Self> {
        let is_short = dds_type.len() <= MAX_NAME_BYTES;
        Some(Self {
            type_name: is_short.then(|| ros_type(dds_type))??,
            type_hash: hash.filter(|hash| is_type_hash(hash)).map(str::to_owned),
            reliability,
            durability,
        })
    }
}

impl From<&RemotePublisher> for Announced {
    fn from(publisher: &RemotePublisher) -> Self {
        Self {
            type_name: publisher.type_name.clone(),
            type_hash: publisher.type_hash.clone(),
            reliability: publisher.reliability,
            durability: publisher.durability,
        }
    }
}

/// A publisher in another process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemotePublisher {
    /// Full name of the topic, such as `/tf`.
    pub topic: String,
    /// Type, such as `tf2_msgs/msg/TFMessage`.
    pub type_name: String,
    /// Type hash (`RIHS01_...`), if announced.
    pub type_hash: Option<String>,
    /// Offered reliability.
    pub reliability: Reliability,
    /// Offered durability.
    pub durability: Durability,
}

impl RemotePublisher {
    /// Publisher of a DDS writer; `None` if its topic is not a ROS topic.
    pub(crate) fn of(
        (dds_name, dds_type): (&str, &str),
        user_data: &[u8],
        (reliability, durability): (Reliability, Durability),
    ) -> Option<Self> {
        let topic = dds_name.strip_prefix("rt")?;
        let hash = announced_hash(user_data);
        Self::on(topic, dds_type, hash.as_deref(), (reliability, durability))
    }

    /// Publisher on a full topic name; `None` if the name or type is invalid.
    pub(crate) fn on(
        topic: &str,
        dds_type: &str,
        hash: Option<&str>,
        (reliability, durability): (Reliability, Durability),
    ) -> Option<Self> {
        let lengths = [topic.len(), dds_type.len()];
        if !topic.starts_with('/') || lengths.into_iter().any(|bytes| bytes > MAX_NAME_BYTES) {
            return None;
        }
        let hash = hash.filter(|hash| is_type_hash(hash));
        Some(Self {
            topic: topic.to_owned(),
            type_name: ros_type(dds_type)?,
            type_hash: hash.map(str::to_owned),
            reliability,
            durability,
        })
    }
}

/// `sensor_msgs/msg/Imu` of `sensor_msgs::msg::dds_::Imu_`.
fn ros_type(dds_type: &str) -> Option<String> {
    let (package, name) = dds_type.strip_suffix('_')?.split_once("::dds_::")?;
    let name = format!("{}/{name}", package.replace("::", "/"));
    // Valid only with the three parts of a ROS type.
    lattice_msgs::dds_type_name(&name).map(|_| name)
}

/// Value of `typehash` in USER_DATA, in the format of rmw_dds_common.
pub(crate) fn announced_hash(user_data: &[u8]) -> Option<String> {
    let text = std::str::from_utf8(user_data).ok()?;
    let mut pairs = text.split(';').filter_map(|pair| pair.split_once('='));
    let (_, hash) = pairs.find(|(key, _)| *key == "typehash")?;
    is_type_hash(hash).then(|| hash.to_owned())
}

/// True for a valid type hash of version 1, the only version.
pub(crate) fn is_type_hash(text: &str) -> bool {
    let digits = text.strip_prefix("RIHS01_").unwrap_or_default();
    digits.len() == 64 && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFERED: (Reliability, Durability) = (Reliability::Reliable, Durability::Volatile);

    #[test]
    fn names_of_dds_become_those_of_ros() {
        let hash = format!("RIHS01_{}", "a".repeat(64));
        let data = format!("enclave=/;typehash={hash};");
        let name = ("rt/robot/imu", "sensor_msgs::msg::dds_::Imu_");
        let found = RemotePublisher::of(name, data.as_bytes(), OFFERED).unwrap();
        assert_eq!(found.topic, "/robot/imu");
        assert_eq!(found.type_name, "sensor_msgs/msg/Imu");
        assert_eq!(found.type_hash, Some(hash));
        let unknown = RemotePublisher::of(name, b"typehash=RIHS01_x;\xff", OFFERED).unwrap();
        assert_eq!(unknown.type_hash, None);
    }

    #[test]
    fn what_is_no_ros_topic_is_passed_over() {
        let long = format!("rt/{}", "x".repeat(MAX_NAME_BYTES));
        for name in [
            ("rq/a/callRequest", "std_srvs::srv::dds_::Empty_Request_"),
            ("ros_discovery_info", "a::msg::dds_::B_"),
            ("rtx", "a::msg::dds_::B_"),
            ("rt/a", "B"),
            ("rt/a", "a::b::dds_::C_"),
            (&long, "a::msg::dds_::B_"),
        ] {
            assert_eq!(RemotePublisher::of(name, b"", OFFERED), None, "{name:?}");
        }
    }
}
