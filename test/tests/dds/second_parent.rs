//! Transforms beside wheel odometry: no frame gets a second parent.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Publisher, Runtime, SubscriptionExecutor};
use lattice_test::clouds::{cloud, header, odometry};
use lattice_test::domain::TestDomain;
use lattice_test::peer::{Nodes, params};
use nalgebra::Isometry3;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);
const START_NS: i64 = 1_700_000_000_000_000_000;
const PERIOD_NS: i64 = 50_000_000;

/// Parent, child and stamp of a transform.
type Edge = (String, String, i64);

fn transform(parent: &str, child: &str, stamp_ns: i64) -> TransformStamped {
    let mut transform = TransformStamped {
        header: header(parent, stamp_ns),
        child_frame_id: child.to_owned(),
        ..TransformStamped::default()
    };
    transform.transform.rotation.w = 1.0;
    transform
}

/// A robot with a GNSS pose, a lidar, and wheel odometry that publishes odom -> base_link.
struct Robot {
    poses: Publisher<Odometry>,
    clouds: Publisher<PointCloud2>,
    tf: Publisher<TFMessage>,
    mapped: Receiver<Arc<PointCloud2>>,
    stamp_ns: i64,
}

impl Robot {
    /// Sends poses, transforms and clouds until `count` clouds have passed the transformer.
    fn drive(&mut self, mut count: usize) {
        let begin = Instant::now();
        while count > 0 {
            self.stamp_ns += PERIOD_NS;
            let odom = transform("odom", "base_link", self.stamp_ns);
            let transforms = vec![odom];
            self.tf.publish(TFMessage { transforms }).unwrap();
            let pose = odometry(self.stamp_ns, &Isometry3::identity());
            self.poses.publish(pose).unwrap();
            let scan = cloud("base_link", self.stamp_ns - PERIOD_NS / 2, &[[1.0; 3]]);
            self.clouds.publish(scan).unwrap();
            let passed = self.mapped.recv_timeout(Duration::from_millis(50));
            count -= usize::from(passed.is_ok());
            assert!(begin.elapsed() < PATIENCE, "no cloud passes");
        }
    }
}

/// Transforms of a transformer with these parameters once it has received those of the wheel odometry.
fn published(parameters: &str) -> Vec<Edge> {
    let domain = TestDomain::take();
    let start = |name| Runtime::with_transport(name, RosArgs::default(), &domain.transport());
    let [robot_runtime, listener_runtime] = ["robot", "listener"].map(|name| start(name).unwrap());
    let robot = robot_runtime.node("robot").unwrap();
    let listener = listener_runtime.node("listener").unwrap();
    let (mapped_sender, mapped) = channel();
    let on_points = move |points| drop(mapped_sender.send(points));
    let (edge_sender, edges) = channel();
    let on_tf = move |message: Arc<TFMessage>| {
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            let edge: Edge = (
                parent.clone(),
                child.clone(),
                transform.header.stamp.to_ns(),
            );
            let _ = edge_sender.send(edge);
        }
    };
    let shared = SubscriptionExecutor::Shared;
    let _subscriptions = (
        listener
            .subscribe("points_enu", Qos::SCANS, shared, on_points)
            .unwrap(),
        listener.subscribe("/tf", Qos::TF, shared, on_tf).unwrap(),
    );
    let given = format!("ins.source:=odometry ins.topic:=odom {parameters}");
    let nodes = Nodes::start(&domain, &[("enu_transformer", params(&given))]);
    let mut robot = Robot {
        poses: robot.publisher("odom", Qos::INS).unwrap(),
        clouds: robot.publisher("points", Qos::SCANS).unwrap(),
        tf: robot.publisher("/tf", Qos::TF).unwrap(),
        mapped,
        stamp_ns: START_NS,
    };
    // The listener and the transformer.
    let begin = Instant::now();
    while robot.tf.subscriber_count() < 2 {
        assert!(begin.elapsed() < PATIENCE, "nobody subscribes to /tf");
        std::thread::yield_now();
    }
    // Transforms may come after the first poses.
    robot.drive(5);
    assert!(robot.tf.flush(PATIENCE));
    robot.drive(5);
    let known_ns = robot.stamp_ns;
    robot.drive(10);
    nodes.finish();
    // After all that the transformer has sent, which is acknowledged when it ends.
    let end = transform("end", "end", 0);
    let transforms = vec![end];
    robot.tf.publish(TFMessage { transforms }).unwrap();
    let mut found = Vec::new();
    loop {
        let edge = edges.recv_timeout(PATIENCE).unwrap();
        match edge.0.as_str() {
            "end" => return found,
            "map" if edge.2 > known_ns => found.push(edge),
            _ => {}
        }
    }
}

#[test]
fn beside_wheel_odometry_the_base_gets_no_second_parent() {
    let found = published("");
    assert_eq!(found, [], "map -> base_link beside odom -> base_link");
}

#[test]
fn beside_wheel_odometry_the_odometry_frame_is_placed_in_the_map() {
    let found = published("odom_frame:=odom");
    let edges = found.iter().map(|(_, child, _)| child.as_str());
    assert!(!found.is_empty());
    assert!(edges.into_iter().all(|child| child == "odom"), "{found:?}");
}
