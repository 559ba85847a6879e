//! The transport between two participants, in one process and over loopback.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::rcl_interfaces::Log;
use lattice_msgs::rosgraph_msgs::Clock;
use lattice_msgs::sensor_msgs::{Imu, PointCloud2, PointField};
use lattice_msgs::std_msgs::String as RosString;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::{RosMessage, cdr};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{
    Load, Node, PublishError, Runtime, RuntimeError, StaticTfBroadcaster, Subscription, logging,
};
use lattice_test::domain::TestDomain;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

fn runtime(domain: &TestDomain, name: &str) -> Runtime {
    with_args(domain, name, &[])
}

fn with_args(domain: &TestDomain, name: &str, args: &[&str]) -> Runtime {
    let args = ["--ros-args"].iter().chain(args).map(|&arg| arg.to_owned());
    let args = RosArgs::parse(args).unwrap();
    Runtime::with_transport(name, args, &domain.transport()).unwrap()
}

fn text(data: &str) -> RosString {
    RosString {
        data: data.to_owned(),
    }
}

fn cloud(bytes: usize) -> PointCloud2 {
    let mut cloud = PointCloud2 {
        height: 1,
        width: u32::try_from(bytes / 16).unwrap(),
        point_step: 16,
        row_step: u32::try_from(bytes).unwrap(),
        is_dense: true,
        ..PointCloud2::default()
    };
    cloud.header.frame_id = "map".to_owned();
    cloud.fields = vec![PointField {
        name: "x".to_owned(),
        datatype: PointField::FLOAT32,
        count: 1,
        ..PointField::default()
    }];
    let data: Vec<u8> = (0..bytes).map(|i| (i * 31 % 251) as u8).collect();
    cloud.data = data.into();
    cloud
}

/// Messages of a topic, in a channel.
fn hear<M: RosMessage>(
    node: &Node,
    topic: &str,
    qos: Qos,
    load: Load,
) -> (Subscription, Receiver<Arc<M>>) {
    let (sender, receiver) = channel();
    let handler = move |message| {
        // The test may have heard enough.
        let _ = sender.send(message);
    };
    let subscription = node.subscribe::<M>(topic, qos, load, handler).unwrap();
    (subscription, receiver)
}

/// Completes when the publisher has a subscriber.
macro_rules! wait_for_subscriber {
    ($publisher:expr) => {{
        let (sender, joined) = channel();
        $publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).expect("a subscriber");
    }};
}

/// Completes when both sides know each other: only then does nothing best-effort go amiss.
macro_rules! wait_for_match {
    ($publisher:expr, $subscription:expr) => {{
        wait_for_subscriber!($publisher);
        let (sender, joined) = channel();
        $subscription.on_publisher_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).expect("a publisher");
    }};
}

mod bytes;
mod end;
mod process;

/// Completes when `reached` is true, asked on a timer of the runtime.
fn wait_until(runtime: &Runtime, mut reached: impl FnMut() -> bool + Send + 'static) {
    let (sender, done) = channel();
    runtime.timer(Duration::from_millis(5), move || {
        if reached() {
            let _ = sender.send(());
        }
    });
    done.recv_timeout(PATIENCE).expect("the state waited for");
}

#[test]
fn small_messages_arrive_in_order() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from
        .publisher::<RosString>("chatter", Qos::DEFAULT)
        .unwrap();
    let (subscription, heard) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    wait_for_subscriber!(publisher);
    for i in 0..50 {
        publisher.publish(text(&i.to_string())).unwrap();
    }
    for i in 0..50 {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, i.to_string());
    }
    let counts = (subscription.publisher_count(), publisher.subscriber_count());
    assert_eq!(counts, (1, 1));
    assert!(publisher.flush(PATIENCE));
    assert_eq!((publisher.sent(), publisher.dropped()), (50, 0));
}

#[test]
fn clouds_of_two_megabytes_arrive_equal_by_either_qos() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let message = Arc::new(cloud(2_000_000));
    for (topic, qos) in [("reliable", Qos::reliable(5)), ("best_effort", Qos::SENSOR)] {
        let publisher = from.publisher::<PointCloud2>(topic, qos).unwrap();
        let (subscription, heard) = hear::<PointCloud2>(&to, topic, qos, Load::Large);
        wait_for_match!(publisher, subscription);
        for _ in 0..3 {
            publisher.publish(Arc::clone(&message)).unwrap();
            assert_eq!(heard.recv_timeout(PATIENCE).unwrap(), message, "{topic}");
        }
        assert_eq!(subscription.lost(), 0);
    }
}

#[test]
fn a_burst_longer_than_the_depth_waits_for_its_reader() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from
        .publisher::<PointCloud2>("chunks", Qos::reliable(5))
        .unwrap();
    let (_subscription, heard) =
        hear::<PointCloud2>(&to, "chunks", Qos::reliable(200), Load::Large);
    wait_for_subscriber!(publisher);
    let chunk = Arc::new(cloud(50_000));
    for _ in 0..200 {
        publisher.publish(Arc::clone(&chunk)).unwrap();
    }
    assert!(publisher.flush(PATIENCE));
    assert_eq!((publisher.sent(), publisher.dropped()), (200, 0));
    for _ in 0..200 {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap(), chunk);
    }
}

#[test]
fn what_a_slow_subscriber_misses_is_counted() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from
        .publisher::<PointCloud2>("points", Qos::reliable(100))
        .unwrap();
    let (gate, opened) = channel();
    let subscription = to
        .subscribe::<PointCloud2>("points", Qos::SENSOR, Load::Large, move |_| {
            let _ = opened.recv();
        })
        .unwrap();
    wait_for_match!(publisher, subscription);
    // Of each hundred it takes one, and the cache keeps a few.
    let message = Arc::new(cloud(10_000));
    let start = Instant::now();
    while subscription.lost() == 0 {
        assert!(start.elapsed() < PATIENCE);
        for _ in 0..100 {
            publisher.publish(Arc::clone(&message)).unwrap();
        }
        assert!(publisher.flush(PATIENCE));
        gate.send(()).unwrap();
    }
    assert!(subscription.lost() + subscription.received() <= publisher.sent());
    drop(gate);
}

#[test]
fn a_qos_that_does_not_match_shows_in_diagnostics() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let _publisher = from.publisher::<Imu>("imu", Qos::INS).unwrap();
    let (_subscription, _heard) = hear::<Imu>(&to, "imu", Qos::reliable(200), Load::Small);
    let (_diagnostics, heard) =
        hear::<DiagnosticArray>(&to, "/diagnostics", Qos::DIAGNOSTICS, Load::Small);
    let mut missing = vec![
        ("a: transport", "/imu incompatible_subscribers"),
        ("b: transport", "/imu incompatible_publishers"),
    ];
    while !missing.is_empty() {
        let message = heard.recv_timeout(PATIENCE).unwrap();
        assert!(message.header.stamp.to_ns() > 0);
        for status in &message.status {
            let keys: Vec<_> = status.values.iter().map(|v| v.key.as_str()).collect();
            assert!(keys.contains(&"socket_receive_buffer_bytes"));
            let before = missing.len();
            missing.retain(|(name, key)| status.name != *name || !keys.contains(key));
            if missing.len() < before {
                assert_eq!(status.level, DiagnosticStatus::WARN);
            }
        }
    }
}

#[test]
fn qos_parameters_override_the_code() {
    let domain = TestDomain::take();
    let a = runtime(&domain, "a");
    let b = with_args(&domain, "b", &["-p", "qos.imu.reliability:=best_effort"]);
    let publisher = a
        .node("a")
        .unwrap()
        .publisher::<Imu>("imu", Qos::INS)
        .unwrap();
    let to = b.node("b").unwrap();
    let (subscription, heard) = hear::<Imu>(&to, "imu", Qos::reliable(200), Load::Small);
    wait_for_match!(publisher, subscription);
    publisher.publish(Imu::default()).unwrap();
    heard.recv_timeout(PATIENCE).unwrap();
}

#[test]
fn simulated_time_follows_the_clock() {
    let domain = TestDomain::take();
    let a = runtime(&domain, "a");
    let b = with_args(&domain, "b", &["-p", "use_sim_time:=true"]);
    let publisher = a
        .node("a")
        .unwrap()
        .publisher::<Clock>("/clock", Qos::CLOCK_PLAYER)
        .unwrap();
    let clock = b.node("b").unwrap().clock();
    assert!(clock.is_sim());
    assert_eq!(clock.now_ns(), 0);
    let stamp_ns = 1_234_567_890_123;
    // Best effort: what is sent before both sides know each other is lost.
    a.timer(Duration::from_millis(5), move || {
        let clock = Time::from_ns(stamp_ns);
        let _ = publisher.publish(Clock { clock });
    });
    wait_until(&b, move || clock.now_ns() == stamp_ns);
}

#[test]
fn the_log_of_the_process_is_on_rosout() {
    let domain = TestDomain::take();
    logging::init(&RosArgs::default(), "logger").unwrap();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let to = b.node("b").unwrap();
    let (_subscription, heard) = hear::<Log>(&to, "/rosout", Qos::ROSOUT, Load::Small);
    log::warn!(target: "lattice_nodes::test", "of interest");
    let line = loop {
        let line = heard.recv_timeout(PATIENCE).unwrap();
        if line.msg == "of interest" {
            break line;
        }
    };
    assert_eq!((line.level, line.name.as_str()), (Log::WARN, "logger"));
    assert!(line.file.ends_with("transport/mod.rs"));
    drop(a);
}
