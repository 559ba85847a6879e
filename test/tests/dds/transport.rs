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
fn one_process_shares_the_message_itself() {
    let domain = TestDomain::take();
    let runtime = runtime(&domain, "a");
    let (from, to) = (runtime.node("a").unwrap(), runtime.node("b").unwrap());
    let publisher = from
        .publisher::<PointCloud2>("points", Qos::SENSOR)
        .unwrap();
    let (_subscription, heard) = hear::<PointCloud2>(&to, "/points", Qos::SENSOR, Load::Large);
    assert_eq!(publisher.subscriber_count(), 1);
    let message = Arc::new(cloud(1600));
    publisher.publish(Arc::clone(&message)).unwrap();
    assert!(Arc::ptr_eq(
        &heard.recv_timeout(PATIENCE).unwrap(),
        &message
    ));
    assert_eq!(publisher.sent(), 0, "nobody outside listens");
    let refused = to.publisher::<RosString>("points", Qos::DEFAULT);
    assert!(matches!(refused, Err(RuntimeError::TypeMismatch { .. })));
}

#[test]
fn a_subscriber_in_the_process_does_not_hold_up_those_outside() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let qos = Qos::reliable(5);
    for (topic, load, subscribe_first) in [
        ("first_small", Load::Small, true),
        ("first_large", Load::Large, true),
        ("second_small", Load::Small, false),
        ("second_large", Load::Large, false),
    ] {
        let before = subscribe_first.then(|| hear::<RosString>(&from, topic, qos, load));
        let publisher = from.publisher::<RosString>(topic, qos).unwrap();
        let (_here, heard_here) =
            before.unwrap_or_else(|| hear::<RosString>(&from, topic, qos, load));
        let (there, heard_there) = hear::<RosString>(&to, topic, Qos::reliable(100), load);
        let counted = publisher.clone();
        wait_until(&a, move || counted.subscriber_count() == 2);
        for i in 0..100 {
            publisher.publish(text(&i.to_string())).unwrap();
        }
        assert!(publisher.flush(PATIENCE), "{topic}");
        for i in 0..100 {
            for heard in [&heard_here, &heard_there] {
                let message = heard.recv_timeout(PATIENCE).unwrap();
                assert_eq!(message.data, i.to_string(), "{topic}");
            }
        }
        assert_eq!((publisher.dropped(), there.lost()), (0, 0), "{topic}");
        assert_eq!(publisher.subscriber_count(), 2, "{topic}");
    }
}

#[test]
fn a_subscription_hears_this_process_and_others() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let (here, heard) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    let inside = to.publisher::<RosString>("chatter", Qos::DEFAULT).unwrap();
    let outside = from
        .publisher::<RosString>("chatter", Qos::DEFAULT)
        .unwrap();
    wait_until(&b, move || here.publisher_count() == 2);
    wait_for_subscriber!(outside);
    for publisher in [inside, outside] {
        publisher.publish(text("once")).unwrap();
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "once");
    }
}

#[test]
fn a_late_joiner_hears_what_was_latched() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let from = a.node("a").unwrap();
    let publisher = from.publisher::<RosString>("origin", Qos::LATCHED).unwrap();
    publisher.publish(text("here")).unwrap();
    assert!(publisher.flush(PATIENCE));
    assert_eq!(publisher.sent(), 0, "serialised for nobody");
    for (runtime, name) in [(&a, "same_process"), (&b, "b")] {
        let node = runtime.node(name).unwrap();
        let (_subscription, heard) = hear::<RosString>(&node, "origin", Qos::LATCHED, Load::Small);
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "here", "{name}");
    }
}

#[test]
fn a_second_subscription_hears_only_what_comes_after_it() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from
        .publisher::<RosString>("chatter", Qos::DEFAULT)
        .unwrap();
    let (_first, heard_first) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    wait_for_subscriber!(publisher);
    publisher.publish(text("before")).unwrap();
    assert_eq!(heard_first.recv_timeout(PATIENCE).unwrap().data, "before");
    let (_second, heard_second) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    let counted = publisher.clone();
    wait_until(&a, move || counted.subscriber_count() == 2);
    publisher.publish(text("after")).unwrap();
    for heard in [heard_first, heard_second] {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "after");
    }
}

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
fn raw_messages_arrive_as_they_are() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let qos = Qos::reliable(100);
    let publisher = from
        .raw_publisher("/chatter", RosString::TYPE, qos)
        .unwrap();
    let (_there, heard) = hear::<RosString>(&to, "chatter", qos, Load::Small);
    wait_for_subscriber!(publisher);
    for i in 0..100 {
        let bytes = cdr::to_vec(&text(&i.to_string())).unwrap();
        publisher.publish_blocking(bytes).unwrap();
    }
    assert!(publisher.flush(PATIENCE));
    for i in 0..100 {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, i.to_string());
    }
    for bad in [
        vec![],
        vec![0, 1, 0],
        vec![0, 0, 0, 0, 1],
        vec![0, 7, 0, 0, 1],
    ] {
        let refused = publisher.publish_blocking(bad);
        assert!(matches!(
            refused,
            Err(PublishError::NotLittleEndianCdr { .. })
        ));
    }
    let refused = from.raw_publisher("/x", "std_msgs/String/x/y", qos);
    assert!(matches!(refused, Err(RuntimeError::TypeName { .. })));
}

#[test]
fn undecodable_and_long_samples_are_counted_and_the_next_arrives() {
    let domain = TestDomain::take();
    let a = runtime(&domain, "a");
    let b = with_args(&domain, "b", &["-p", "max_message_bytes:=1000"]);
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    for (topic, qos, load) in [
        ("reliable", Qos::DEFAULT, Load::Small),
        ("best_effort", Qos::INS, Load::Large),
    ] {
        let publisher = from
            .raw_publisher(&format!("/{topic}"), RosString::TYPE, qos)
            .unwrap();
        let (subscription, heard) = hear::<RosString>(&to, topic, qos, load);
        wait_for_match!(publisher, subscription);
        let length_lies = vec![0, 1, 0, 0, 255, 255, 255, 255, b'x', 0];
        let not_utf8 = vec![0, 1, 0, 0, 3, 0, 0, 0, 0xff, 0xfe, 0];
        let too_long = cdr::to_vec(&text(&"x".repeat(1000))).unwrap();
        let good = cdr::to_vec(&text("good")).unwrap();
        for bytes in [length_lies, not_utf8, too_long, good] {
            publisher.publish_blocking(bytes).unwrap();
        }
        assert_eq!(
            heard.recv_timeout(PATIENCE).unwrap().data,
            "good",
            "{topic}"
        );
        assert_eq!(
            (subscription.undecodable(), subscription.received()),
            (3, 1),
            "{topic}"
        );
    }
}

#[test]
fn a_message_is_decoded_by_who_works_on_it() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let (qos, (sender, heard)) = (Qos::DEFAULT, channel());
    let subscription = to
        .subscribe_undecoded::<RosString>("chatter", qos, Load::Small, move |message| {
            let _ = sender.send(message);
        })
        .unwrap();
    let next = || heard.recv_timeout(PATIENCE).unwrap();
    let there = from
        .raw_publisher("/chatter", RosString::TYPE, qos)
        .unwrap();
    wait_for_match!(there, subscription);
    let good = cdr::to_vec(&text("outside")).unwrap();
    let length = good.len();
    there
        .publish_blocking(vec![0, 1, 0, 0, 9, 0, 0, 0])
        .unwrap();
    there.publish_blocking(good).unwrap();
    let (bad, good) = (next(), next());
    assert_eq!(
        (subscription.received(), subscription.undecodable()),
        (0, 0)
    );
    assert!(bad.decode().is_none());
    assert_eq!(good.bytes(|_| 0), length);
    assert_eq!(good.decode().unwrap().data, "outside");
    let here = to.publisher::<RosString>("chatter", qos).unwrap();
    here.publish(text("here")).unwrap();
    let shared = next();
    assert_eq!(shared.bytes(|message| message.data.len()), 4);
    assert_eq!(shared.decode().unwrap().data, "here");
    assert_eq!(
        (subscription.received(), subscription.undecodable()),
        (2, 1)
    );
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
    assert!(line.file.ends_with("transport.rs"));
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
