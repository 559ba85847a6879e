//! Types that other processes publish on the output topics of this one.

use std::sync::{Arc, Mutex, Weak};

use crate::config::names::shown;
use crate::sync::lock;
use crate::transport::peers::Peers;
use crate::transport::remote::RemotePublisher;

/// Publishers of this process with their types.
#[derive(Default)]
pub(crate) struct OutputTypes(Mutex<Vec<Output>>);

struct Output {
    /// Peers of the publisher, which are dropped with it.
    peers: Weak<Peers>,
    type_name: String,
    /// True after the warning of its topic.
    is_logged: bool,
}

impl OutputTypes {
    /// Adds a publisher, and warns if one of `known` publishes another type on its topic.
    pub(crate) fn add(&self, peers: &Arc<Peers>, type_name: &str, known: &[RemotePublisher]) {
        let mut outputs = lock(&self.0);
        outputs.retain(|output| output.peers.strong_count() > 0);
        outputs.push(Output {
            peers: Arc::downgrade(peers),
            type_name: type_name.to_owned(),
            is_logged: false,
        });
        drop(outputs);
        for line in known.iter().flat_map(|publisher| self.on_found(publisher)) {
            log::warn!("{line}");
        }
    }

    /// Warnings due to a discovered publisher: one for each topic.
    pub(crate) fn on_found(&self, publisher: &RemotePublisher) -> Vec<String> {
        let mut lines = Vec::new();
        for output in lock(&self.0).iter_mut().filter(|output| !output.is_logged) {
            let (topic, theirs) = (&publisher.topic, &publisher.type_name);
            let is_here = |peers: Arc<Peers>| peers.topic() == topic;
            if *theirs != output.type_name && output.peers.upgrade().is_some_and(is_here) {
                output.is_logged = true;
                lines.push(line(topic, &output.type_name, theirs));
            }
        }
        lines
    }
}

fn line(topic: &str, ours: &str, theirs: &str) -> String {
    let last = topic.rsplit('/').next().unwrap_or_default();
    format!(
        "{topic} has two types: this process publishes {ours} and another one {}; `ros2 topic echo` and rosbag2 refuse \
         such a topic: remap ours with -r {topic}:=/NAMESPACE/{last}",
        shown(theirs)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::qos::Qos;

    const GRID: &str = "nav_msgs/msg/OccupancyGrid";
    const MAP: &str = "lattice_msgs/msg/LatticeMap";

    fn publisher(topic: &str, type_name: &str) -> RemotePublisher {
        RemotePublisher {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            type_hash: None,
            reliability: Qos::DEFAULT.reliability,
            durability: Qos::DEFAULT.durability,
        }
    }

    #[test]
    fn another_type_on_an_output_is_named_once() {
        let outputs = OutputTypes::default();
        let peers = Arc::new(Peers::new("/map", "subscriber", log::Level::Info));
        outputs.add(&peers, MAP, &[]);
        for other in [publisher("/map", MAP), publisher("/a/map", GRID)] {
            assert!(outputs.on_found(&other).is_empty(), "{other:?}");
        }
        let line = "/map has two types: this process publishes lattice_msgs/msg/LatticeMap and another one \
            nav_msgs/msg/OccupancyGrid; `ros2 topic echo` and rosbag2 refuse such a topic: remap ours with \
            -r /map:=/NAMESPACE/map";
        assert_eq!(outputs.on_found(&publisher("/map", GRID)), [line]);
        assert!(outputs.on_found(&publisher("/map", GRID)).is_empty());
    }

    #[test]
    fn a_publisher_that_is_known_before_counts_and_an_ended_output_does_not() {
        let outputs = OutputTypes::default();
        let peers = Arc::new(Peers::new("/map", "subscriber", log::Level::Info));
        outputs.add(&peers, MAP, &[publisher("/map", GRID)]);
        assert!(
            outputs.on_found(&publisher("/map", GRID)).is_empty(),
            "logged"
        );
        let ended = Arc::new(Peers::new("/b", "subscriber", log::Level::Info));
        outputs.add(&ended, MAP, &[]);
        drop(ended);
        assert!(outputs.on_found(&publisher("/b", GRID)).is_empty());
    }
}
