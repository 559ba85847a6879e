//! Clock, log, parameters, diagnostics and end of a process on the transport.

use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::rcl_interfaces::Log;
use lattice_msgs::rosgraph_msgs::Clock;
use lattice_msgs::sensor_msgs::Imu;
use lattice_msgs::std_msgs::String as RosString;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{
    PublishError, RuntimeError, StaticTfBroadcaster, SubscriptionExecutor, TfGuard, logging,
};
use lattice_test::domain::TestDomain;

use super::{PATIENCE, Two, assert_counted, count_to, runtime, text, wait_until};

#[test]
fn static_transforms_go_in_one_message() {
    let two = Two::start();
    let guard = TfGuard::new(|_, _| String::new());
    let broadcaster = StaticTfBroadcaster::new(&two.from, &guard).unwrap();
    for (child, x) in [("laser", 1.0), ("ins", 2.0), ("laser", 3.0)] {
        let mut transform = TransformStamped {
            child_frame_id: child.to_owned(),
            ..TransformStamped::default()
        };
        transform.transform.translation.x = x;
        broadcaster.send([transform]).unwrap();
    }
    let qos = Qos::TF_STATIC_LISTENER;
    let (_subscription, heard) =
        two.hear::<TFMessage>("/tf_static", qos, SubscriptionExecutor::Shared);
    let frames = loop {
        let message = heard.recv_timeout(PATIENCE).unwrap();
        let frame = |t: &TransformStamped| (t.child_frame_id.clone(), t.transform.translation.x);
        let frames: Vec<_> = message.transforms.iter().map(frame).collect();
        if frames.iter().any(|(_, x)| *x == 3.0) {
            break frames;
        }
    };
    assert_eq!(frames, [("ins".to_owned(), 2.0), ("laser".to_owned(), 3.0)]);
}

/// Diagnostics of both ends of `/imu` where they do not go together.
const INCOMPATIBLE: [(&str, &str); 2] = [
    ("a: transport", "/imu incompatible_subscribers"),
    ("b: transport", "/imu incompatible_publishers"),
];

#[test]
fn a_qos_that_does_not_match_shows_in_diagnostics() {
    let two = Two::start();
    let _publisher = two.publisher::<Imu>("imu", Qos::INS);
    let (_subscription, _heard) =
        two.hear::<Imu>("imu", Qos::reliable(200), SubscriptionExecutor::Shared);
    let (_diagnostics, heard) = two.hear::<DiagnosticArray>(
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
    );
    let mut missing = INCOMPATIBLE.to_vec();
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
fn another_type_on_a_topic_is_no_match() {
    let two = Two::start();
    let publisher = two.publisher::<RosString>("imu", Qos::reliable(10));
    let (subscription, _heard) =
        two.hear::<Imu>("imu", Qos::reliable(10), SubscriptionExecutor::Shared);
    let (_diagnostics, heard) = two.hear::<DiagnosticArray>(
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
    );
    let mut missing = INCOMPATIBLE.to_vec();
    while !missing.is_empty() {
        count_to(1, &publisher);
        for status in &heard.recv_timeout(PATIENCE).unwrap().status {
            let has = |key: &str| status.values.iter().any(|value| value.key == key);
            missing.retain(|(name, key)| status.name != *name || !has(key));
        }
    }
    assert_eq!((publisher.subscriber_count(), publisher.sent()), (0, 0));
    assert_eq!(
        (subscription.publisher_count(), subscription.undecodable()),
        (0, 0)
    );
}

#[test]
fn qos_parameters_override_the_code() {
    let two = Two::with_args(&["-p", "qos.imu.reliability:=best_effort"]);
    let publisher = two.publisher::<Imu>("imu", Qos::INS);
    let (subscription, heard) =
        two.hear::<Imu>("imu", Qos::reliable(200), SubscriptionExecutor::Shared);
    wait_for_match!(publisher, subscription);
    publisher.publish(Imu::default()).unwrap();
    heard.recv_timeout(PATIENCE).unwrap();
}

#[test]
fn simulated_time_follows_the_clock() {
    let two = Two::with_args(&["-p", "use_sim_time:=true"]);
    let publisher = two.publisher::<Clock>("/clock", Qos::CLOCK_PLAYER);
    let clock = two.to.clock();
    assert_eq!(clock.now_ns(), 0);
    let stamp_ns = 1_234_567_890_123;
    // Best effort: what is sent before both sides know each other is lost.
    let _timer = two.a.timer(Duration::from_millis(5), move || {
        let clock = Time::from_ns(stamp_ns);
        let _ = publisher.publish(Clock { clock });
    });
    wait_until(&two.b, move || clock.now_ns() == stamp_ns);
}

#[test]
fn the_log_of_the_process_is_on_rosout() {
    // Fails if another test was first, which has the same.
    let _ = logging::init(&RosArgs::default(), "logger");
    let two = Two::start();
    let (_subscription, heard) =
        two.hear::<Log>("/rosout", Qos::ROSOUT, SubscriptionExecutor::Shared);
    log::warn!(target: "lattice_nodes::test", "of interest");
    let line = loop {
        let line = heard.recv_timeout(PATIENCE).unwrap();
        if line.msg == "of interest" {
            break line;
        }
    };
    assert_eq!((line.level, line.name.as_str()), (Log::WARN, "logger"));
    assert!(line.file.ends_with("process.rs"));
}

#[test]
fn a_second_node_of_the_same_name_is_told_as_rcl_tells_it() {
    let _ = logging::init(&RosArgs::default(), "logger");
    let two = Two::with_args(&["-r", "again:__node:=twin", "-r", "other:__node:=twin"]);
    let (_subscription, heard) =
        two.hear::<Log>("/rosout", Qos::ROSOUT, SubscriptionExecutor::Shared);
    let _nodes = ["other", "again"].map(|name| two.b.node(name).unwrap());
    let line = loop {
        let line = heard.recv_timeout(PATIENCE).unwrap();
        if line.msg.contains("twin") {
            break line;
        }
    };
    assert_eq!(line.level, Log::WARN);
    let rcl = "Publisher already registered for node name: 'twin'. If this is due to multiple nodes with the \
               same name then all logs for the logger named 'twin' will go out over the existing publisher. \
               As soon as any node with that name is destructed it will unregister the publisher, \
               preventing any further logs for that name from being published on the rosout topic.";
    assert!(line.msg.starts_with(rcl), "{}", line.msg);
    assert!(line.msg.ends_with("rename one with `-r NODE:__node:=NAME`"));
}

#[test]
fn shutdown_stops_timers_sends_what_is_queued_and_leaves_at_once() {
    let two = Two::start();
    let qos = Qos::reliable(20);
    let publisher = two.publisher("last", qos);
    let (subscription, heard) = two.hear("last", qos, SubscriptionExecutor::Dedicated);
    wait_for_subscriber!(publisher);
    let (ticks, ticked) = channel();
    let _timer = two.a.timer(Duration::from_millis(1), move || {
        let _ = ticks.send(());
    });
    ticked.recv_timeout(PATIENCE).unwrap();
    count_to(20, &publisher);
    let shutdown = two.a.shutdown_handle();
    assert!(!shutdown.is_requested());
    std::thread::spawn(move || shutdown.request());
    two.a.spin().unwrap();
    while ticked.recv_timeout(PATIENCE).is_ok() {}
    assert_counted(20, &heard);
    wait_until(&two.b, move || subscription.publisher_count() == 0);
    let late = publisher.publish(text("late"));
    assert!(matches!(late, Ok(()) | Err(PublishError::Closed { .. })));
    let late = two.from.publisher::<RosString>("late", Qos::DEFAULT);
    assert!(matches!(late, Err(RuntimeError::Closed { .. })));
}

#[test]
fn the_last_messages_of_the_process_reach_their_handlers() {
    let domain = TestDomain::take();
    for executor in [
        SubscriptionExecutor::Shared,
        SubscriptionExecutor::Dedicated,
    ] {
        let runtime = runtime(&domain, "a", &[]);
        let node = runtime.node("a").unwrap();
        let publisher = node.publisher::<RosString>("last", Qos::DEFAULT).unwrap();
        let (shutdown, (sender, heard)) = (runtime.shutdown_handle(), channel());
        let _subscription = node
            .subscribe::<RosString>("last", Qos::DEFAULT, executor, move |message| {
                // The end begins while all but the first wait.
                shutdown.wait();
                let _ = sender.send(message);
            })
            .unwrap();
        count_to(100, &publisher);
        runtime.shutdown_handle().request();
        runtime.spin().unwrap();
        assert_eq!(heard.try_iter().count(), 100, "{executor:?}");
    }
}

#[test]
fn a_handler_that_panics_ends_the_process_in_good_order() {
    let domain = TestDomain::take();
    for executor in [
        SubscriptionExecutor::Shared,
        SubscriptionExecutor::Dedicated,
    ] {
        let runtime = runtime(&domain, "a", &[]);
        let node = runtime.node("a").unwrap();
        let publisher = node.publisher::<RosString>("bomb", Qos::DEFAULT).unwrap();
        let _subscription = node
            .subscribe::<RosString>("bomb", Qos::DEFAULT, executor, |_| panic!("on purpose"))
            .unwrap();
        publisher.publish(text("tick")).unwrap();
        assert!(matches!(runtime.spin(), Err(RuntimeError::Panicked { .. })));
    }
}
