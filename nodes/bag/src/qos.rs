//! QoS in bags: integers up to metadata version 8, names from 9 on.

use serde::{Deserialize, Serialize};
use serde_yaml::Value;

/// QoS offered by a recorded publisher, as far as playback needs it.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(from = "RecordedQos", into = "WrittenQos")]
pub struct BagQos {
    /// Keep all samples, not only the newest `depth`.
    pub keep_all: bool,
    /// History depth otherwise.
    pub depth: u64,
    /// Reliable.
    pub reliable: bool,
    /// Transient local.
    pub latched: bool,
}

impl Default for BagQos {
    /// Keep last 10, reliable, volatile.
    fn default() -> Self {
        BagQos {
            keep_all: false,
            depth: 10,
            reliable: true,
            latched: false,
        }
    }
}

/// Policies that are read, by number or name; others are ignored. A missing, null or invalid policy
/// has its most common value.
#[derive(Deserialize)]
struct RecordedQos {
    #[serde(default)]
    history: Value,
    depth: Option<u64>,
    #[serde(default)]
    reliability: Value,
    #[serde(default)]
    durability: Value,
}

fn is(policy: &Value, number: i64, name: &str) -> bool {
    let found = policy.as_str();
    policy.as_i64() == Some(number) || found.is_some_and(|f| f.eq_ignore_ascii_case(name))
}

impl From<RecordedQos> for BagQos {
    fn from(recorded: RecordedQos) -> Self {
        BagQos {
            keep_all: is(&recorded.history, 2, "keep_all"),
            depth: recorded.depth.unwrap_or(BagQos::default().depth),
            reliable: !is(&recorded.reliability, 2, "best_effort"),
            latched: is(&recorded.durability, 1, "transient_local"),
        }
    }
}

/// All policies in the form of rosbag2; those not represented here are infinite.
#[derive(Serialize)]
struct WrittenQos {
    history: &'static str,
    depth: u64,
    reliability: &'static str,
    durability: &'static str,
    deadline: WrittenDuration,
    lifespan: WrittenDuration,
    liveliness: &'static str,
    liveliness_lease_duration: WrittenDuration,
    avoid_ros_namespace_conventions: bool,
}

#[derive(Clone, Copy, Serialize)]
struct WrittenDuration {
    sec: u64,
    nsec: u64,
}

/// Infinite duration: 2^63 - 1 ns.
const INFINITE: WrittenDuration = WrittenDuration {
    sec: 9_223_372_036,
    nsec: 854_775_807,
};

impl From<BagQos> for WrittenQos {
    fn from(qos: BagQos) -> Self {
        let choose = |first, yes, no| if first { yes } else { no };
        WrittenQos {
            history: choose(qos.keep_all, "keep_all", "keep_last"),
            depth: qos.depth,
            reliability: choose(qos.reliable, "reliable", "best_effort"),
            durability: choose(qos.latched, "transient_local", "volatile"),
            deadline: INFINITE,
            lifespan: INFINITE,
            liveliness: "automatic",
            liveliness_lease_duration: INFINITE,
            avoid_ros_namespace_conventions: false,
        }
    }
}

impl BagQos {
    /// Parses the YAML list that storage files and metadata up to version 8 embed as text.
    pub(crate) fn parse_list(text: &str) -> Result<Vec<BagQos>, serde_yaml::Error> {
        Ok(crate::yaml::from_text::<Option<Vec<BagQos>>>(text)?.unwrap_or_default())
    }

    /// YAML list as embedded in storage files of metadata version 9.
    pub(crate) fn to_text(list: &[BagQos]) -> Result<String, serde_yaml::Error> {
        Ok(serde_yaml::to_string(list)?.trim_end().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_mean_the_same() {
        let numbers = "- history: 2\n  depth: 7\n  reliability: 2\n  durability: 1\n  deadline: {sec: 0, nsec: 5}\n";
        let names = "- history: keep_all\n  depth: 7\n  reliability: best_effort\n  durability: TRANSIENT_LOCAL\n";
        let expected = BagQos {
            keep_all: true,
            depth: 7,
            reliable: false,
            latched: true,
        };
        for text in [numbers, names] {
            let parsed = BagQos::parse_list(text).unwrap();
            assert_eq!(parsed.as_slice(), std::slice::from_ref(&expected));
        }
    }

    #[test]
    fn text_round_trips() {
        let latched = BagQos {
            depth: 1,
            latched: true,
            ..BagQos::default()
        };
        let list = vec![BagQos::default(), latched];
        assert_eq!(
            BagQos::parse_list(&BagQos::to_text(&list).unwrap()).unwrap(),
            list
        );
        assert_eq!(BagQos::to_text(&[]).unwrap(), "[]");
        assert_eq!(BagQos::parse_list("").unwrap(), vec![]);
    }

    #[test]
    fn strange_policies_are_those_of_most_publishers() {
        let text = "- {history: 77, depth: null, reliability: maybe, durability: [1]}";
        let parsed = BagQos::parse_list(text).unwrap();
        assert_eq!(parsed, [BagQos::default()]);
        assert!(BagQos::parse_list("{not: [a, list").is_err());
    }
}
