//! Maps as a mapper publishes them, and the transform of a robot.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::domain::TestDomain;

/// Publishers in the place of a mapper and of a robot.
pub struct MapDriver {
    pub maps: Publisher<LatticeMap>,
    pub updates: Publisher<LatticeMapUpdate>,
    _tf: Publisher<TFMessage>,
    asked: Receiver<()>,
    _requests: Subscription,
    _node: Node,
    _runtime: Runtime,
}

/// Frames of the robot and of a site with their positions in the map, metres.
pub fn transforms(places: &[(&str, [f64; 3])]) -> TFMessage {
    let transform = |(frame, at_m): &(&str, [f64; 3])| {
        let mut transform = TransformStamped::default();
        transform.header.frame_id = "map".to_owned();
        transform.child_frame_id = (*frame).to_owned();
        let to = &mut transform.transform;
        [to.translation.x, to.translation.y, to.translation.z] = *at_m;
        to.rotation.w = 1.0;
        transform
    };
    TFMessage {
        transforms: places.iter().map(transform).collect(),
    }
}

impl MapDriver {
    pub fn start(domain: &TestDomain, places: &[(&str, [f64; 3])]) -> Self {
        let args = RosArgs::parse([]).unwrap();
        let runtime = Runtime::with_transport("driver", args, &domain.transport()).unwrap();
        let node = runtime.node("driver").unwrap();
        let maps = node.publisher::<LatticeMap>("voxel_map", Qos::MAP).unwrap();
        let updates = node.publisher("voxel_map_updates", Qos::DELTAS).unwrap();
        let tf = node
            .publisher::<TFMessage>("/tf_static", Qos::TF_STATIC)
            .unwrap();
        tf.publish(transforms(places)).unwrap();
        // As a mapper does: a keyframe for each request, and for each subscriber that comes.
        let (request, asked) = channel();
        let by_topic = request.clone();
        let requests = node.subscribe(
            "lattice_mapper/request_keyframe",
            Qos::DEFAULT,
            SubscriptionExecutor::Shared,
            move |_: Arc<Empty>| {
                let _ = by_topic.send(());
            },
        );
        maps.on_subscriber_joined(move || {
            let _ = request.send(());
        });
        Self {
            maps,
            updates,
            _tf: tf,
            asked,
            _requests: requests.unwrap(),
            _node: node,
            _runtime: runtime,
        }
    }

    /// Waits until somebody wants the map.
    pub fn until_asked(&self, patience: Duration) {
        self.asked.recv_timeout(patience).unwrap();
    }

    /// Publishes a keyframe.
    pub fn send(&self, keyframe: &[LatticeMap]) {
        for chunk in keyframe {
            self.maps.publish(chunk.clone()).unwrap();
        }
    }
}
