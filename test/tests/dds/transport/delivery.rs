//! Messages from publishers to subscribers: complete, in order, and counted where they are not.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Instant;

use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::String as RosString;
use lattice_msgs::{RosMessage, cdr};
use lattice_runtime::qos::Qos;
use lattice_runtime::{Load, PublishError, RuntimeError};
use lattice_test::domain::TestDomain;

use super::{PATIENCE, hear, runtime, text, wait_until, with_args};

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
