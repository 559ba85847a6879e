//! Quality of service in bags: integers up to metadata version 8, names from 9 on.

use serde::{Deserialize, Serialize};

macro_rules! policy {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $number:literal $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
        #[serde(from = "Policy", into = "&'static str")]
        pub enum $name { $($(#[$vdoc])* $variant,)* }

        impl From<Policy> for $name {
            fn from(policy: Policy) -> Self {
                match policy {
                    $(Policy::Number($number) => Self::$variant,)*
                    $(Policy::Name(name) if name.eq_ignore_ascii_case($text) => Self::$variant,)*
                    _ => Self::Unknown,
                }
            }
        }

        impl From<$name> for &'static str {
            fn from(policy: $name) -> Self {
                match policy { $($name::$variant => $text,)* }
            }
        }
    };
}

/// A policy in either of its two spellings.
#[derive(Deserialize)]
#[serde(untagged)]
enum Policy {
    Number(i64),
    Name(String),
}

policy! {
    /// Samples that a writer keeps.
    BagHistory {
        /// The middleware's choice.
        SystemDefault = 0 "system_default",
        /// The newest `depth`.
        KeepLast = 1 "keep_last",
        /// All of them.
        KeepAll = 2 "keep_all",
        /// Not known.
        Unknown = 3 "unknown",
    }
}

policy! {
    /// Repetition of lost samples.
    BagReliability {
        /// The middleware's choice.
        SystemDefault = 0 "system_default",
        /// Sent again.
        Reliable = 1 "reliable",
        /// Not sent again.
        BestEffort = 2 "best_effort",
        /// Not known.
        Unknown = 3 "unknown",
        /// As the other side has it.
        BestAvailable = 4 "best_available",
    }
}

policy! {
    /// Old samples for late joiners.
    BagDurability {
        /// The middleware's choice.
        SystemDefault = 0 "system_default",
        /// They do ("latched").
        TransientLocal = 1 "transient_local",
        /// They do not.
        Volatile = 2 "volatile",
        /// Not known.
        Unknown = 3 "unknown",
        /// As the other side has it.
        BestAvailable = 4 "best_available",
    }
}

/// The quality of service that one recorded publisher offered.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(default, into = "WrittenQos")]
pub struct BagQos {
    /// Samples that are kept.
    pub history: BagHistory,
    /// The number of samples kept under [`BagHistory::KeepLast`].
    pub depth: u64,
    /// Repetition of lost samples.
    pub reliability: BagReliability,
    /// Old samples for late joiners.
    pub durability: BagDurability,
}

impl Default for BagQos {
    /// Keep the last 10, reliable, volatile.
    fn default() -> Self {
        BagQos {
            history: BagHistory::KeepLast,
            depth: 10,
            reliability: BagReliability::Reliable,
            durability: BagDurability::Volatile,
        }
    }
}

/// All policies as rosbag2 wants them; those that nothing here reads have no bound.
#[derive(Serialize)]
struct WrittenQos {
    history: BagHistory,
    depth: u64,
    reliability: BagReliability,
    durability: BagDurability,
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

/// No bound: 2^63 - 1 ns.
const INFINITE: WrittenDuration = WrittenDuration {
    sec: 9_223_372_036,
    nsec: 854_775_807,
};

impl From<BagQos> for WrittenQos {
    fn from(qos: BagQos) -> Self {
        WrittenQos {
            history: qos.history,
            depth: qos.depth,
            reliability: qos.reliability,
            durability: qos.durability,
            deadline: INFINITE,
            lifespan: INFINITE,
            liveliness: "automatic",
            liveliness_lease_duration: INFINITE,
            avoid_ros_namespace_conventions: false,
        }
    }
}

impl BagQos {
    /// True if the publisher kept samples for late joiners.
    pub fn is_latched(&self) -> bool {
        self.durability == BagDurability::TransientLocal
    }

    /// Parses the YAML list that storage files and metadata up to version 8 carry as text.
    pub(crate) fn parse_list(text: &str) -> Result<Vec<BagQos>, serde_yaml::Error> {
        Ok(serde_yaml::from_str::<Option<Vec<BagQos>>>(text)?.unwrap_or_default())
    }

    /// The YAML list as storage files of metadata version 9 carry it.
    pub(crate) fn to_text(list: &[BagQos]) -> Result<String, serde_yaml::Error> {
        Ok(serde_yaml::to_string(list)?.trim_end().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_mean_the_same() {
        let numbers = "- history: 1\n  depth: 7\n  reliability: 2\n  durability: 1\n  deadline: {sec: 0, nsec: 5}\n";
        let names = "- history: keep_last\n  depth: 7\n  reliability: best_effort\n  durability: TRANSIENT_LOCAL\n";
        let parsed = BagQos::parse_list(numbers).unwrap();
        assert_eq!(parsed, BagQos::parse_list(names).unwrap());
        assert_eq!(parsed[0].depth, 7);
        assert_eq!(parsed[0].reliability, BagReliability::BestEffort);
        assert!(parsed[0].is_latched());
    }

    #[test]
    fn text_round_trips() {
        let list = vec![
            BagQos::default(),
            BagQos {
                depth: 1,
                durability: BagDurability::TransientLocal,
                ..BagQos::default()
            },
        ];
        assert_eq!(
            BagQos::parse_list(&BagQos::to_text(&list).unwrap()).unwrap(),
            list
        );
        assert_eq!(BagQos::to_text(&[]).unwrap(), "[]");
        assert_eq!(BagQos::parse_list("").unwrap(), vec![]);
    }

    #[test]
    fn strange_policies_are_unknown() {
        let parsed = BagQos::parse_list("- {history: 77, reliability: maybe}").unwrap();
        assert_eq!(parsed[0].history, BagHistory::Unknown);
        assert_eq!(parsed[0].reliability, BagReliability::Unknown);
        assert!(BagQos::parse_list("{not: [a, list").is_err());
    }
}
