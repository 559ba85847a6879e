//! Common parts of the storage readers.

use std::collections::HashMap;

use super::{BagError, BagQos, TopicInfo};

/// Index of a storage file after opening it.
#[derive(Clone, Debug, Default)]
pub(crate) struct StorageInfo {
    pub topics: Vec<TopicInfo>,
    pub message_count: u64,
    /// First and last log time.
    pub range_ns: Option<(i64, i64)>,
    /// Invalid message rows: without topic, time or content.
    pub implausible: u64,
    pub damage: Option<BagError>,
}

/// A message of one storage file.
pub(crate) struct StorageMessage {
    /// Index into the file's topics.
    pub topic: usize,
    pub log_time_ns: i64,
    /// True in a damaged part: its checksum is wrong or missing.
    pub unchecked: bool,
    pub data: Vec<u8>,
}

/// Messages in order of log time; nothing follows the first error.
pub(crate) type StorageStream = Box<dyn Iterator<Item = Result<StorageMessage, BagError>> + Send>;

/// Selection of messages by topic and time.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    /// Selected topics, by index of the file's topics.
    pub topics: Vec<bool>,
    /// Start of the log time range, inclusive.
    pub start_ns: i64,
    /// End of the log time range, exclusive.
    pub end_ns: Option<i64>,
    /// True to continue after damage.
    pub past_damage: bool,
}

impl Filter {
    pub(crate) fn wants(&self, topic: usize, log_time_ns: i64) -> bool {
        self.wants_topic(topic)
            && log_time_ns >= self.start_ns
            && self.end_ns.is_none_or(|end_ns| log_time_ns < end_ns)
    }

    pub(crate) fn wants_topic(&self, topic: usize) -> bool {
        self.topics.get(topic).copied().unwrap_or(false)
    }

    /// True if the selected range overlaps a closed range.
    pub(crate) fn overlaps(&self, (first_ns, last_ns): (i64, i64)) -> bool {
        last_ns >= self.start_ns && self.end_ns.is_none_or(|end_ns| first_ns < end_ns)
    }
}

/// Topics by name and type; an empty type matches any.
#[derive(Default)]
pub(crate) struct TopicIndex {
    by_type: HashMap<(String, String), usize>,
    /// First topic of each name.
    by_name: HashMap<String, usize>,
}

impl TopicIndex {
    pub(crate) fn new(topics: &[TopicInfo]) -> TopicIndex {
        let mut index = TopicIndex::default();
        for (at, topic) in topics.iter().enumerate() {
            index.add(at, &topic.name, &topic.type_name);
        }
        index
    }

    fn add(&mut self, at: usize, name: &str, type_name: &str) {
        let key = (name.to_owned(), type_name.to_owned());
        self.by_type.entry(key).or_insert(at);
        self.by_name.entry(name.to_owned()).or_insert(at);
    }

    /// First topic of this name and type.
    pub(crate) fn find(&self, name: &str, type_name: &str) -> Option<usize> {
        if type_name.is_empty() {
            return self.by_name.get(name).copied();
        }
        let of = |type_name: &str| {
            let key = (name.to_owned(), type_name.to_owned());
            self.by_type.get(&key).copied()
        };
        of(type_name).into_iter().chain(of("")).min()
    }

    /// Sets the type of a topic.
    fn complete(&mut self, at: usize, name: &str, type_name: &str) {
        self.by_type.remove(&(name.to_owned(), String::new()));
        self.add(at, name, type_name);
    }
}

/// Adds or completes a topic; returns its index.
pub(crate) fn merge_topic(
    topics: &mut Vec<TopicInfo>,
    places: &mut TopicIndex,
    topic: &TopicInfo,
    counted: bool,
) -> usize {
    let found = places.find(&topic.name, &topic.type_name);
    let Some((index, known)) = found.and_then(|index| Some((index, topics.get_mut(index)?))) else {
        places.add(topics.len(), &topic.name, &topic.type_name);
        topics.push(topic.clone());
        return topics.len() - 1;
    };
    if known.type_name.is_empty() && !topic.type_name.is_empty() {
        known.type_name.clone_from(&topic.type_name);
        places.complete(index, &topic.name, &topic.type_name);
    }
    if known.type_hash.is_empty() {
        known.type_hash.clone_from(&topic.type_hash);
    }
    if known.offered_qos.is_empty() {
        known.offered_qos.clone_from(&topic.offered_qos);
    }
    known.definition = known.definition.take().or_else(|| topic.definition.clone());
    let bytes = known.message_bytes.into_iter().chain(topic.message_bytes);
    known.message_bytes = bytes.reduce(u64::saturating_add);
    if counted {
        known.message_count = known.message_count.saturating_add(topic.message_count);
    }
    index
}

/// QoS profiles embedded in a storage file; an invalid text counts as unknown.
pub(crate) fn lenient_qos(topic: &str, text: &str) -> Vec<BagQos> {
    BagQos::parse_list(text).unwrap_or_else(|error| {
        log::warn!("{topic}: invalid offered_qos_profiles ({error}); QoS is unknown");
        Vec::new()
    })
}

/// Full type name: `pkg/Type` of some writers becomes `pkg/msg/Type`.
pub(crate) fn full_type_name(name: &str) -> String {
    match name.split_once('/') {
        Some((package, rest)) if !rest.contains('/') => format!("{package}/msg/{rest}"),
        _ => name.to_owned(),
    }
}

/// Language of a message definition, as named in storage files.
pub(crate) fn definition_encoding(text: &str) -> &'static str {
    match text {
        "" => "",
        _ if text.starts_with("=") && text.trim_start_matches('=').starts_with("\nIDL: ") => {
            "ros2idl"
        }
        _ => "ros2msg",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn type_names_are_completed() {
        assert_eq!(full_type_name("std_msgs/String"), "std_msgs/msg/String");
        assert_eq!(full_type_name("std_msgs/msg/String"), "std_msgs/msg/String");
        assert_eq!(full_type_name("plain"), "plain");
    }

    #[test]
    fn definitions_tell_their_language() {
        assert_eq!(definition_encoding("int32 x\n"), "ros2msg");
        assert_eq!(
            definition_encoding(&format!("{}\nIDL: a/msg/B\n", "=".repeat(80))),
            "ros2idl"
        );
        assert_eq!(
            definition_encoding(&format!("{}\nMSG: a/msg/B\n", "=".repeat(80))),
            "ros2msg"
        );
        assert_eq!(definition_encoding(""), "");
    }

    #[test]
    fn the_end_is_excluded_and_the_start_included() {
        let filter = Filter {
            topics: vec![true, false],
            start_ns: 10,
            end_ns: Some(20),
            past_damage: false,
        };
        assert!(filter.wants(0, 10) && filter.wants(0, 19));
        assert!(
            !filter.wants(0, 9)
                && !filter.wants(0, 20)
                && !filter.wants(1, 15)
                && !filter.wants(2, 15)
        );
        assert!(filter.overlaps((0, 10)) && filter.overlaps((19, 30)));
        assert!(!filter.overlaps((0, 9)) && !filter.overlaps((20, 30)));
    }
}
