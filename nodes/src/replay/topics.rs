//! Topics of a log that carry clouds, poses and transforms.

use std::collections::BTreeMap;

use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::sensor_msgs::PointCloud2;
use thiserror::Error;

use crate::enu_transformer::ins::InsSource;
use lattice_bag::{BagError, BagReader, ReadOptions};

/// Reason for which a log cannot be replayed.
#[derive(Debug, Error)]
pub enum TopicError {
    /// A slice that is empty or begins before the log.
    #[error(
        "no clouds from {from_s} s to {to_s} s: a slice begins at 0 s or later and ends behind its beginning"
    )]
    Slice {
        /// Asked for.
        from_s: f64,
        /// Asked for.
        to_s: f64,
    },
    /// A topic that was asked for.
    #[error("no topic '{name}' of type {type_name} in the log; it has {has}")]
    Missing {
        /// Asked for.
        name: String,
        /// Needed type.
        type_name: &'static str,
        /// Topics of that type, or of any.
        has: String,
    },
    /// Nothing to map.
    #[error("no {type_name} topic in the log; it has {has}")]
    NoClouds {
        /// Needed type.
        type_name: &'static str,
        /// Topics of the log.
        has: String,
    },
    /// No INS.
    #[error(
        "no INS topic in the log (Odometry, INSPVAX, INSPVA, NavSatFix with Imu, PoseStamped); it has {has}"
    )]
    NoIns {
        /// Topics of the log.
        has: String,
    },
    /// The log itself.
    #[error(transparent)]
    Bag(#[from] BagError),
}

/// Role of a topic in the replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A sensor's clouds.
    Cloud,
    /// One kind of INS message.
    Ins(&'static str),
    /// `/tf` or, if true, `/tf_static`.
    Transforms(bool),
}

/// Wishes of the user; empty or `None` is "find out".
#[derive(Clone, Debug, Default)]
pub struct TopicWishes {
    /// Cloud topics.
    pub points: Vec<String>,
    /// Source of poses.
    pub source: Option<InsSource>,
    /// Topic of the INS.
    pub ins: Option<String>,
}

/// Roles by topic of the log, and the source of poses.
#[derive(Debug)]
pub struct TopicPlan {
    /// Role by index of the topic in the log.
    pub roles: BTreeMap<usize, Role>,
    /// Source of poses.
    pub source: InsSource,
}

/// Poses of the machine itself come first: they need no lever arm.
const PREFERRED: [InsSource; 5] = [
    InsSource::Odometry,
    InsSource::Inspvax,
    InsSource::Inspva,
    InsSource::NavsatfixImu,
    InsSource::Pose,
];

impl TopicPlan {
    /// Clouds of the log that the replay is about.
    pub fn clouds(&self, bag: &BagReader) -> u64 {
        let clouds = self.roles.iter().filter(|(_, role)| **role == Role::Cloud);
        let topics = clouds.filter_map(|(i, _)| bag.topics().get(*i));
        topics.map(|topic| topic.message_count).sum()
    }

    /// Names of the topics with a role that is wanted.
    pub(super) fn names(&self, bag: &BagReader, wanted: impl Fn(Role) -> bool) -> Vec<String> {
        let topics = self.roles.iter().filter(|(_, role)| wanted(**role));
        let topics = topics.filter_map(|(i, _)| bag.topics().get(*i));
        topics.map(|topic| topic.name.clone()).collect()
    }
}

/// Gives every topic that is of use its role.
pub fn plan(bag: &BagReader, wishes: &TopicWishes) -> Result<TopicPlan, TopicError> {
    let mut roles = BTreeMap::new();
    let clouds = if wishes.points.is_empty() {
        cloud_topics(bag)?
    } else {
        let find = |name: &String| find(bag, name, PointCloud2::TYPE);
        wishes.points.iter().map(find).collect::<Result<_, _>>()?
    };
    roles.extend(clouds.into_iter().map(|topic| (topic, Role::Cloud)));
    let first_of = |type_name: &str| {
        let mut topics = bag.topics().iter();
        topics.position(|topic| topic.type_name == type_name && topic.message_count > 0)
    };
    let complete = |source: &InsSource| {
        let mut names = source.type_names().iter();
        names.all(|name| first_of(name).is_some())
    };
    let source = wishes.source.or(PREFERRED.into_iter().find(complete));
    let source = source.ok_or_else(|| TopicError::NoIns { has: listing(bag) })?;
    for (i, type_name) in source.type_names().iter().enumerate() {
        let topic = match (&wishes.ins, i) {
            (Some(name), 0) => find(bag, name, type_name)?,
            _ => first_of(type_name).ok_or_else(|| TopicError::Missing {
                name: "*".into(),
                type_name,
                has: listing(bag),
            })?,
        };
        roles.insert(topic, Role::Ins(type_name));
    }
    for (i, topic) in bag.topics().iter().enumerate() {
        match topic.name.as_str() {
            "/tf" => roles.insert(i, Role::Transforms(false)),
            "/tf_static" => roles.insert(i, Role::Transforms(true)),
            _ => None,
        };
    }
    Ok(TopicPlan { roles, source })
}

/// One cloud topic per sensor frame: the same scan is often there again with labels.
fn cloud_topics(bag: &BagReader) -> Result<Vec<usize>, TopicError> {
    let mut by_frame: BTreeMap<String, (bool, u64, usize)> = BTreeMap::new();
    for (i, topic) in bag.topics().iter().enumerate() {
        if topic.type_name != PointCloud2::TYPE || topic.message_count == 0 {
            continue;
        }
        let options = ReadOptions {
            topics: Some(vec![topic.name.clone()]),
            ..ReadOptions::default()
        };
        let Some(first) = bag.messages(&options)?.next() else {
            continue;
        };
        let Ok(cloud) = cdr::from_slice::<PointCloud2>(&first?.data) else {
            continue;
        };
        let labelled = cloud.fields.iter().any(|field| field.name == "label");
        let candidate = (labelled, u64::MAX - topic.message_count, i);
        by_frame
            .entry(cloud.header.frame_id)
            .and_modify(|best| *best = (*best).min(candidate))
            .or_insert(candidate);
    }
    if by_frame.is_empty() {
        return Err(TopicError::NoClouds {
            type_name: PointCloud2::TYPE,
            has: listing(bag),
        });
    }
    Ok(by_frame.into_values().map(|(_, _, topic)| topic).collect())
}

fn find(bag: &BagReader, name: &str, type_name: &'static str) -> Result<usize, TopicError> {
    let mut topics = bag.topics().iter();
    topics
        .position(|topic| topic.name == name && topic.type_name == type_name)
        .ok_or_else(|| TopicError::Missing {
            name: name.to_owned(),
            type_name,
            has: listing(bag),
        })
}

fn listing(bag: &BagReader) -> String {
    let topics = bag.topics().iter();
    let names = topics.map(|topic| format!("{} ({})", topic.name, topic.type_name));
    let names: Vec<String> = names.collect();
    match names.is_empty() {
        true => "no topics".into(),
        false => names.join(", "),
    }
}
