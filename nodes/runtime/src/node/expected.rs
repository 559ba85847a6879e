//! Required input topics, reported while they have no publisher.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use super::diagnostics::{Diagnostics, Level};
use super::shared::Shared;
use super::timer::Timer;
use crate::communication::subscription::{Intake, Subscription};
use crate::config::names::{self, shown};
use crate::sync::lock;
use crate::task_thread::TaskThread;
use crate::transport::remote::RemotePublisher;

/// Time allowed for a publisher to appear, wall clock.
const PATIENCE: Duration = Duration::from_secs(3);
/// Period of checks.
const PERIOD: Duration = Duration::from_secs(1);
/// Limit of alternative topics named in a message.
const MAX_NAMED: usize = 8;

/// Subscriptions of a node that require a publisher.
#[derive(Default)]
pub(super) struct Expected(Mutex<State>);

#[derive(Default)]
struct State {
    inputs: Vec<Input>,
    is_watched: bool,
}

struct Input {
    intake: Weak<Intake>,
    due: Instant,
    named: Named,
    source: Source,
}

/// Warning already logged for a topic without a publisher.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Named {
    No,
    Alone,
    /// Logged with alternative topics.
    WithOthers,
}

/// Origin of a topic's messages.
#[derive(Clone, Copy)]
pub(super) struct Source {
    pub from: &'static str,
    pub parameter: Option<&'static str>,
    pub is_like: fn(&str) -> bool,
}

impl Expected {
    /// Adds subscriptions; true if the first [`Watch`] is to be started.
    pub(super) fn add<'a>(
        &self,
        subscriptions: impl IntoIterator<Item = &'a Subscription>,
        source: Source,
    ) -> bool {
        let now = Instant::now();
        let input = |of: &Subscription| Input {
            intake: Arc::downgrade(&of.intake),
            due: now.checked_add(PATIENCE).unwrap_or(now),
            named: Named::No,
            source,
        };
        let mut state = lock(&self.0);
        state.inputs.extend(subscriptions.into_iter().map(input));
        !std::mem::replace(&mut state.is_watched, true)
    }
}

/// Periodic check of the publishers.
pub(super) struct Watch {
    pub expected: Arc<Expected>,
    pub shared: Weak<Shared>,
    pub diagnostics: Diagnostics,
    pub namespace: String,
}

impl Watch {
    /// Checks periodically on the io thread.
    pub(super) fn start(self, io: &TaskThread) {
        Timer::start(io, PERIOD, move || self.look(Instant::now())).detach();
    }

    fn look(&self, now: Instant) {
        let Some(shared) = self.shared.upgrade() else {
            return;
        };
        let mut state = lock(&self.expected.0);
        state.inputs.retain(|input| input.intake.strong_count() > 0);
        let (mut counts, mut missing) = (Vec::new(), Vec::new());
        for input in &mut state.inputs {
            let Some(intake) = input.intake.upgrade() else {
                continue;
            };
            let count = intake.peers.count();
            if count == 0 && now >= input.due {
                let remotes = shared.remote_publishers();
                let wanted = (&*intake.topic, &*intake.type_name);
                let (line, now) = line(wanted, &remotes, &self.namespace, input.source);
                if now > input.named {
                    input.named = now;
                    log::warn!("{line}");
                }
                missing.push(line);
            }
            counts.push((intake.topic.clone(), count));
        }
        drop(state);
        if counts.is_empty() {
            return;
        }
        let (level, message) = match counts.iter().all(|(_, count)| *count > 0) {
            _ if !missing.is_empty() => (Level::Warn, missing.join("; ")),
            true => (Level::Ok, "publishers on all topics".to_owned()),
            false => (Level::Ok, "waiting for publishers".to_owned()),
        };
        self.diagnostics.set("inputs", level, message, counts);
    }
}

/// Message about a topic without a publisher, and the warning it counts as.
fn line(
    (topic, type_name): (&str, &str),
    remotes: &[RemotePublisher],
    namespace: &str,
    source: Source,
) -> (String, Named) {
    let Source {
        from,
        parameter,
        is_like,
    } = source;
    let begin = format!(
        "no publisher on {topic} ({type_name}) after {} s",
        PATIENCE.as_secs()
    );
    let here = || remotes.iter().filter(|of| of.topic == topic);
    if here().any(|of| of.type_name == type_name) {
        let line = format!(
            "{begin} matches: a publisher has incompatible QoS; set qos.{topic}.reliability or \
             qos.{topic}.durability"
        );
        return (line, Named::WithOthers);
    }
    let others = remotes.iter().filter(|of| {
        let is_valid = names::validate_full_name(&of.topic).is_ok();
        of.type_name == type_name && of.topic != topic && is_valid && is_like(&of.topic)
    });
    // Topics with the same last part first.
    let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
    let others: BTreeSet<(bool, &str)> = others
        .map(|of| (last(&of.topic) != last(topic), &*of.topic))
        .collect();
    let set = parameter.map(|parameter| format!("or set {parameter}"));
    let set = set.unwrap_or_default();
    let remedy = match others.first() {
        None => format!(
            "there is no alternative topic; start {from} with this ROS_DOMAIN_ID{}{set}",
            if set.is_empty() { "" } else { ", " }
        ),
        Some((_, first)) => {
            let named: Vec<&str> = others
                .iter()
                .map(|(_, topic)| *topic)
                .take(MAX_NAMED)
                .collect();
            let more = match others.len().saturating_sub(MAX_NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let prefix = format!("{}/", namespace.trim_end_matches('/'));
            let relative = topic.strip_prefix(&prefix).unwrap_or(topic);
            format!(
                "of that type there are: {}{more}; remap with -r {relative}:={first}{}{set}",
                named.join(", "),
                if set.is_empty() { "" } else { " " }
            )
        }
    };
    let other_type = here().next().map(|of| shown(&of.type_name));
    let other_type = other_type.map(|of| format!("; {topic} is published as {of}"));
    let named = match others.is_empty() && other_type.is_none() {
        true => Named::Alone,
        false => Named::WithOthers,
    };
    let other_type = other_type.unwrap_or_default();
    (format!("{begin}; {remedy}{other_type}"), named)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::qos::Qos;

    const CLOUD: &str = "sensor_msgs/msg/PointCloud2";
    const SOURCE: Source = Source {
        from: "the driver",
        parameter: Some("points_topics"),
        is_like: |topic| !topic.ends_with("/map_centers"),
    };

    fn remotes(of: &[(&str, &str)]) -> Vec<RemotePublisher> {
        let remote = |(topic, type_name): &(&str, &str)| RemotePublisher {
            topic: (*topic).to_owned(),
            type_name: (*type_name).to_owned(),
            type_hash: None,
            reliability: Qos::DEFAULT.reliability,
            durability: Qos::DEFAULT.durability,
        };
        of.iter().map(remote).collect()
    }

    #[test]
    fn topics_of_the_type_are_named() {
        let there = remotes(&[
            ("/velodyne_points", CLOUD),
            ("/os_cloud_node/points", CLOUD),
            ("/velodyne_points", CLOUD),
            ("/map_centers", CLOUD),
            ("/imu", "sensor_msgs/msg/Imu"),
            ("/b\u{1b}", CLOUD),
        ]);
        assert_eq!(
            line(("/points", CLOUD), &there, "/", SOURCE).0,
            "no publisher on /points (sensor_msgs/msg/PointCloud2) after 3 s; of that type there are: \
             /os_cloud_node/points, /velodyne_points; remap with -r points:=/os_cloud_node/points or set \
             points_topics"
        );
        let source = Source {
            parameter: None,
            ..SOURCE
        };
        let robot = line(("/robot/points", CLOUD), &there[..1], "/robot", source).0;
        assert!(
            robot.ends_with("remap with -r points:=/velodyne_points"),
            "{robot}"
        );
        let other = line(("/robot2/points", CLOUD), &there[..1], "/robot", source).0;
        assert!(other.contains("-r /robot2/points:=/vel"), "{other}");
        let many = ('a'..='z').map(|c| format!("/{c}")).collect::<Vec<_>>();
        let many: Vec<_> = many.iter().map(|name| (&**name, CLOUD)).collect();
        let many = line(("/points", CLOUD), &remotes(&many), "/", SOURCE).0;
        assert!(many.contains("/g, /h and 18 more; remap"), "{many}");
    }

    #[test]
    fn another_type_on_the_topic_is_named() {
        let there = remotes(&[("/points", "sensor_msgs/msg/LaserScan")]);
        assert_eq!(
            line(("/points", CLOUD), &there, "/", SOURCE).0,
            "no publisher on /points (sensor_msgs/msg/PointCloud2) after 3 s; there is no alternative \
             topic; start the driver with this ROS_DOMAIN_ID, or set points_topics; /points is \
             published as sensor_msgs/msg/LaserScan"
        );
    }

    #[test]
    fn a_publisher_that_does_not_match_is_named() {
        let there = remotes(&[("/points", CLOUD)]);
        let line = line(("/points", CLOUD), &there, "/", SOURCE).0;
        assert!(
            line.contains("incompatible QoS; set qos./points.reliability"),
            "{line}"
        );
    }

    #[test]
    fn a_topic_is_named_again_when_others_appear() {
        let named = |there: &[(&str, &str)]| {
            let (_, named) = line(("/points", CLOUD), &remotes(there), "/", SOURCE);
            named
        };
        let alone = named(&[("/imu", "sensor_msgs/msg/Imu")]);
        assert!(alone > Named::No);
        assert!(named(&[("/a", CLOUD)]) > alone);
        assert!(named(&[("/points", "a/msg/B")]) > alone);
    }
}
