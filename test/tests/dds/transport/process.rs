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
use lattice_runtime::{Load, PublishError, RuntimeError, StaticTfBroadcaster, logging};
use lattice_test::domain::TestDomain;

use super::{PATIENCE, hear, runtime, text, wait_until, with_args};

#[test]
fn static_transforms_go_in_one_message() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let broadcaster = StaticTfBroadcaster::new(&a.node("a").unwrap()).unwrap();
    for (child, x) in [("laser", 1.0), ("ins", 2.0), ("laser", 3.0)] {
        let mut transform = TransformStamped {
            child_frame_id: child.to_owned(),
            ..TransformStamped::default()
        };
        transform.transform.translation.x = x;
        broadcaster.send([transform]).unwrap();
    }
    let node = b.node("b").unwrap();
    let qos = Qos::TF_STATIC_LISTENER;
    let (_subscription, heard) = hear::<TFMessage>(&node, "/tf_static", qos, Load::Small);
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
    assert!(line.file.ends_with("process.rs"));
    drop(a);
}

#[test]
fn shutdown_stops_timers_sends_what_is_queued_and_leaves_at_once() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from.publisher::<RosString>("last", Qos::DEFAULT).unwrap();
    let (subscription, heard) = hear::<RosString>(&to, "last", Qos::DEFAULT, Load::Large);
    wait_for_subscriber!(publisher);
    let (ticks, ticked) = channel();
    a.timer(Duration::from_millis(1), move || {
        let _ = ticks.send(());
    });
    ticked.recv_timeout(PATIENCE).unwrap();
    for i in 0..20 {
        publisher.publish(text(&i.to_string())).unwrap();
    }
    let shutdown = a.shutdown_handle();
    assert!(!shutdown.is_requested());
    std::thread::spawn(move || shutdown.request());
    a.spin().unwrap();
    while ticked.recv_timeout(PATIENCE).is_ok() {}
    for i in 0..20 {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, i.to_string());
    }
    wait_until(&b, move || subscription.publisher_count() == 0);
    assert!(matches!(
        publisher.publish(text("late")),
        Ok(()) | Err(PublishError::Closed { .. })
    ));
    let late = from.publisher::<RosString>("late", Qos::DEFAULT);
    assert!(matches!(late, Err(RuntimeError::Closed { .. })));
}

#[test]
fn the_last_messages_of_the_process_reach_their_handlers() {
    let domain = TestDomain::take();
    for load in [Load::Small, Load::Large] {
        let runtime = runtime(&domain, "a");
        let node = runtime.node("a").unwrap();
        let publisher = node.publisher::<RosString>("last", Qos::DEFAULT).unwrap();
        let (shutdown, (sender, heard)) = (runtime.shutdown_handle(), channel());
        let _subscription = node
            .subscribe::<RosString>("last", Qos::DEFAULT, load, move |message| {
                // The end begins while all but the first wait.
                shutdown.wait();
                let _ = sender.send(message);
            })
            .unwrap();
        for i in 0..100 {
            publisher.publish(text(&i.to_string())).unwrap();
        }
        runtime.shutdown_handle().request();
        runtime.spin().unwrap();
        assert_eq!(heard.try_iter().count(), 100, "{load:?}");
    }
}

#[test]
fn a_handler_that_panics_ends_the_process_in_good_order() {
    let domain = TestDomain::take();
    for load in [Load::Small, Load::Large] {
        let runtime = runtime(&domain, "a");
        let node = runtime.node("a").unwrap();
        let publisher = node.publisher::<RosString>("bomb", Qos::DEFAULT).unwrap();
        let _subscription = node
            .subscribe::<RosString>("bomb", Qos::DEFAULT, load, |_| panic!("on purpose"))
            .unwrap();
        publisher.publish(text("tick")).unwrap();
        assert!(matches!(runtime.spin(), Err(RuntimeError::Panicked { .. })));
    }
}
