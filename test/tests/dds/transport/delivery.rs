//! Messages from publishers to subscribers: complete, in order, and counted where they are not.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Instant;

use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::String as RosString;
use lattice_msgs::{RosMessage, cdr};
use lattice_runtime::env::{Network, TransportKind};
use lattice_runtime::qos::Qos;
use lattice_runtime::{Losses, PublishError, RuntimeError, SubscriptionExecutor};

use super::{PATIENCE, Two, assert_counted, assert_heard, count_to, hear, text, wait_until};

fn cloud(bytes: usize) -> Arc<PointCloud2> {
    let data: Vec<u8> = (0..bytes).map(|i| (i * 31 % 251) as u8).collect();
    Arc::new(PointCloud2 {
        data: data.into(),
        ..lattice_test::clouds::cloud("map", 0, &[])
    })
}

#[test]
fn small_messages_arrive_in_order() {
    let two = Two::start();
    let qos = Qos::reliable(50);
    let publisher = two.publisher("chatter", qos);
    let (subscription, heard) = two.hear("chatter", qos, SubscriptionExecutor::Shared);
    wait_for_match!(publisher, subscription);
    count_to(50, &publisher);
    assert_counted(50, &heard);
    let counts = (subscription.publisher_count(), publisher.subscriber_count());
    assert_eq!(counts, (1, 1));
    assert!(publisher.flush(PATIENCE));
    assert_eq!((publisher.sent(), publisher.dropped()), (50, 0));
}

#[test]
fn clouds_of_two_megabytes_arrive_equal_by_either_qos() {
    let two = Two::start();
    let message = cloud(2_000_000);
    for (topic, qos) in [("reliable", Qos::reliable(5)), ("best_effort", Qos::SENSOR)] {
        let publisher = two.publisher::<PointCloud2>(topic, qos);
        let (subscription, heard) =
            two.hear::<PointCloud2>(topic, qos, SubscriptionExecutor::Dedicated);
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
    let two = Two::start();
    let publisher = two.publisher::<PointCloud2>("chunks", Qos::reliable(5));
    let (_subscription, heard) = two.hear::<PointCloud2>(
        "chunks",
        Qos::reliable(200),
        SubscriptionExecutor::Dedicated,
    );
    wait_for_subscriber!(publisher);
    let chunk = cloud(50_000);
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
    let two = Two::start();
    let other = two.a.node("other").unwrap();
    let publisher = two.publisher::<PointCloud2>("points", Qos::SENSOR);
    let (_subscription, heard) = hear::<PointCloud2>(
        &other,
        "/points",
        Qos::SENSOR,
        SubscriptionExecutor::Dedicated,
    );
    assert_eq!(publisher.subscriber_count(), 1);
    let message = cloud(1600);
    publisher.publish(Arc::clone(&message)).unwrap();
    let shared = heard.recv_timeout(PATIENCE).unwrap();
    assert!(Arc::ptr_eq(&shared, &message));
    assert_eq!(publisher.sent(), 0, "nobody outside listens");
    let refused = other.publisher::<RosString>("points", Qos::DEFAULT);
    assert!(matches!(refused, Err(RuntimeError::TypeMismatch { .. })));
}

#[test]
fn a_subscriber_in_the_process_does_not_hold_up_those_outside() {
    let two = Two::start();
    let qos = Qos::reliable(5);
    for (topic, executor, subscribe_first) in [
        ("first_small", SubscriptionExecutor::Shared, true),
        ("first_large", SubscriptionExecutor::Dedicated, true),
        ("second_small", SubscriptionExecutor::Shared, false),
        ("second_large", SubscriptionExecutor::Dedicated, false),
    ] {
        let subscribe = || hear::<RosString>(&two.from, topic, qos, executor);
        let before = subscribe_first.then(subscribe);
        let publisher = two.publisher(topic, qos);
        let (_here, heard_here) = before.unwrap_or_else(subscribe);
        let (there, heard_there) = two.hear(topic, Qos::reliable(100), executor);
        let counted = publisher.clone();
        wait_until(&two.a, move || counted.subscriber_count() == 2);
        count_to(100, &publisher);
        assert!(publisher.flush(PATIENCE), "{topic}");
        assert_counted(100, &heard_here);
        assert_counted(100, &heard_there);
        assert_eq!((publisher.dropped(), there.lost()), (0, 0), "{topic}");
        assert_eq!(publisher.subscriber_count(), 2, "{topic}");
    }
}

#[test]
fn a_subscription_hears_this_process_and_others() {
    let two = Two::start();
    let (here, heard) = two.hear("chatter", Qos::DEFAULT, SubscriptionExecutor::Shared);
    let inside = two.to.publisher("chatter", Qos::DEFAULT).unwrap();
    let outside = two.publisher("chatter", Qos::DEFAULT);
    let here = Arc::new(here);
    let counted = Arc::clone(&here);
    wait_until(&two.b, move || counted.publisher_count() == 2);
    wait_for_subscriber!(outside);
    for publisher in [inside, outside] {
        publisher.publish(text("once")).unwrap();
        assert_heard(&heard, "once");
    }
}

#[test]
fn a_late_joiner_hears_what_was_latched() {
    let two = Two::start();
    let publisher = two.publisher("origin", Qos::LATCHED);
    publisher.publish(text("here")).unwrap();
    assert!(publisher.flush(PATIENCE));
    // Zenoh keeps it before there is a subscriber; for DDS it is not serialized.
    let is_kept = Network::from_env().unwrap().transport != TransportKind::Dds;
    assert_eq!(publisher.sent(), u64::from(is_kept));
    for node in [&two.a.node("other").unwrap(), &two.to] {
        let (_subscription, heard) =
            hear(node, "origin", Qos::LATCHED, SubscriptionExecutor::Shared);
        assert_heard(&heard, "here");
    }
}

#[test]
fn a_second_subscription_hears_only_what_comes_after_it() {
    let two = Two::start();
    let publisher = two.publisher("chatter", Qos::DEFAULT);
    let (_first, heard_first) = two.hear("chatter", Qos::DEFAULT, SubscriptionExecutor::Shared);
    wait_for_subscriber!(publisher);
    publisher.publish(text("before")).unwrap();
    assert_heard(&heard_first, "before");
    let (_second, heard_second) = two.hear("chatter", Qos::DEFAULT, SubscriptionExecutor::Shared);
    let counted = publisher.clone();
    wait_until(&two.a, move || counted.subscriber_count() == 2);
    publisher.publish(text("after")).unwrap();
    assert_heard(&heard_first, "after");
    assert_heard(&heard_second, "after");
}

#[test]
fn raw_messages_arrive_as_they_are() {
    let two = Two::start();
    let qos = Qos::reliable(100);
    let raw = |topic, type_name| two.from.raw_publisher(topic, type_name, None, qos);
    let publisher = raw("/chatter", RosString::TYPE).unwrap();
    let (_there, heard) = two.hear("chatter", qos, SubscriptionExecutor::Shared);
    wait_for_subscriber!(publisher);
    for i in 0..100 {
        let bytes = cdr::to_vec(&text(i)).unwrap();
        publisher.publish_within(bytes, PATIENCE).unwrap();
    }
    assert!(publisher.flush(PATIENCE));
    assert_counted(100, &heard);
    for bad in [&[][..], &[0, 1, 0], &[0, 0, 0, 0, 1], &[0, 7, 0, 0, 1]] {
        let refused = publisher
            .publish_within(bad.to_vec(), PATIENCE)
            .unwrap_err();
        assert!(matches!(refused, PublishError::NotLittleEndianCdr { .. }));
    }
    let refused = raw("/x", "std_msgs/String/x/y");
    assert!(matches!(refused, Err(RuntimeError::TypeName { .. })));
}

#[test]
fn undecodable_and_long_samples_are_counted_and_the_next_arrives() {
    let two = Two::with_args(&["-p", "max_message_bytes:=1000"]);
    for (topic, qos, executor) in [
        ("reliable", Qos::DEFAULT, SubscriptionExecutor::Shared),
        ("best_effort", Qos::INS, SubscriptionExecutor::Dedicated),
    ] {
        let name = format!("/{topic}");
        let publisher = two.from.raw_publisher(&name, RosString::TYPE, None, qos);
        let publisher = publisher.unwrap();
        let (subscription, heard) = two.hear(topic, qos, executor);
        wait_for_match!(publisher, subscription);
        let length_lies = vec![0, 1, 0, 0, 255, 255, 255, 255, b'x', 0];
        let not_utf8 = vec![0, 1, 0, 0, 3, 0, 0, 0, 0xff, 0xfe, 0];
        let too_long = cdr::to_vec(&text("x".repeat(1000))).unwrap();
        let good = cdr::to_vec(&text("good")).unwrap();
        for bytes in [length_lies, not_utf8, too_long, good] {
            publisher.publish_within(bytes, PATIENCE).unwrap();
        }
        assert_heard(&heard, "good");
        let counts = (subscription.undecodable(), subscription.received());
        assert_eq!(counts, (3, 1), "{topic}");
    }
}

#[test]
fn a_message_is_decoded_by_who_works_on_it() {
    let two = Two::start();
    let (qos, (sender, heard)) = (Qos::DEFAULT, channel());
    let handler = move |message| {
        let _ = sender.send(message);
    };
    let subscription =
        two.to
            .subscribe_undecoded("chatter", qos, SubscriptionExecutor::Shared, handler);
    let subscription = subscription.unwrap();
    let counts = || (subscription.received(), subscription.undecodable());
    let next = || heard.recv_timeout(PATIENCE).unwrap();
    let there = two
        .from
        .raw_publisher("/chatter", RosString::TYPE, None, qos);
    let there = there.unwrap();
    wait_for_match!(there, subscription);
    let outside = cdr::to_vec(&text("outside")).unwrap();
    for message in [&[0, 1, 0, 0, 9, 0, 0, 0], &outside[..]] {
        there.publish_within(message.to_vec(), PATIENCE).unwrap();
    }
    let (bad, good) = (next(), next());
    assert_eq!(counts(), (0, 0));
    assert!(bad.decode().is_none());
    assert_eq!(good.bytes(|_: &RosString| 0), outside.len());
    assert_eq!(good.decode().unwrap().data, "outside");
    let here = two.to.publisher("chatter", qos).unwrap();
    here.publish(text("here")).unwrap();
    let shared = next();
    assert_eq!(shared.bytes(|message| message.data.len()), 4);
    assert_eq!(shared.decode().unwrap().data, "here");
    assert_eq!(counts(), (2, 1));
}

#[test]
fn what_a_slow_subscriber_misses_is_counted() {
    let two = Two::start();
    let publisher = two.publisher::<PointCloud2>("points", Qos::reliable(100));
    let (gate, opened) = channel();
    let wait = move |_: Arc<PointCloud2>| {
        let _ = opened.recv();
    };
    let subscription =
        two.to
            .subscribe("points", Qos::SENSOR, SubscriptionExecutor::Dedicated, wait);
    let subscription = subscription.unwrap();
    wait_for_match!(publisher, subscription);
    // Of each hundred it takes one, and the cache keeps a few.
    let message = cloud(10_000);
    let start = Instant::now();
    while subscription.lost() == 0 {
        assert!(start.elapsed() < PATIENCE);
        for _ in 0..100 {
            publisher.publish(Arc::clone(&message)).unwrap();
        }
        assert!(publisher.flush(PATIENCE));
        gate.send(()).unwrap();
    }
    let losses = Losses::default();
    losses.watch([&subscription]);
    let lost = subscription.lost();
    assert!((lost..=subscription.lost()).contains(&losses.lost()));
    assert!(subscription.lost() + subscription.received() <= publisher.sent());
    drop(gate);
}
