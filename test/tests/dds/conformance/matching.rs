//! Endpoints meet if their QoS and types allow it, and what was promised then arrives.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use lattice_msgs::sensor_msgs::{Imu, PointCloud2};
use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::{Node, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::domain::TestDomain;

use super::{PATIENCE, Transport, pairs, runtime};

/// Two ends in this process, as if on two machines.
struct Ends {
    from: Node,
    to: Node,
    _runtimes: [Runtime; 2],
    _domain: TestDomain,
}

impl Ends {
    fn start(from: Transport, to: Transport) -> Self {
        let domain = TestDomain::take();
        let runtimes = [runtime(&domain, from, "from"), runtime(&domain, to, "to")];
        Self {
            from: runtimes[0].node("from").unwrap(),
            to: runtimes[1].node("to").unwrap(),
            _runtimes: runtimes,
            _domain: domain,
        }
    }
}

fn qos_of(number: usize) -> Qos {
    let qos = Qos::latched(10);
    Qos {
        reliability: [Reliability::BestEffort, Reliability::Reliable][number & 1],
        durability: [Durability::Volatile, Durability::TransientLocal][number >> 1 & 1],
        ..qos
    }
}

fn meets(offered: Qos, requested: Qos) -> bool {
    let reliable = |qos: Qos| qos.reliability == Reliability::Reliable;
    let latched = |qos: Qos| qos.durability == Durability::TransientLocal;
    reliable(offered) >= reliable(requested) && latched(offered) >= latched(requested)
}

fn hear(node: &Node, topic: &str, qos: Qos) -> (Subscription, Receiver<Arc<RosString>>) {
    let (sender, heard) = channel();
    let handler = move |message| {
        let _ = sender.send(message);
    };
    let subscription = node.subscribe(topic, qos, SubscriptionExecutor::Shared, handler);
    (subscription.unwrap(), heard)
}

#[test]
fn endpoints_meet_as_their_qos_allows() {
    for (a, b) in pairs() {
        let ends = Ends::start(a, b);
        let mut open = Vec::new();
        let mut apart = Vec::new();
        for (offered, requested) in (0..16).map(|i| (qos_of(i & 3), qos_of(i >> 2))) {
            let topic = format!("t{}", open.len() + apart.len());
            let publisher = ends.from.publisher::<RosString>(&topic, offered).unwrap();
            let (subscription, heard) = hear(&ends.to, &topic, requested);
            let (sender, joined) = channel();
            let theirs = sender.clone();
            publisher.on_subscriber_joined(move || {
                let _ = sender.send(());
            });
            subscription.on_publisher_joined(move || {
                let _ = theirs.send(());
            });
            match meets(offered, requested) {
                true => open.push((publisher, subscription, heard, joined)),
                false => apart.push((publisher, subscription, heard)),
            }
        }
        assert_eq!((open.len(), apart.len()), (9, 7));
        for (publisher, subscription, heard, joined) in &open {
            // Each side knows the other.
            while publisher.subscriber_count() == 0 || subscription.publisher_count() == 0 {
                joined.recv_timeout(PATIENCE).unwrap();
            }
            let data = publisher.topic().to_owned();
            publisher.publish(RosString { data }).unwrap();
            let heard = heard.recv_timeout(PATIENCE);
            assert_eq!(heard.unwrap().data, publisher.topic(), "{} to {}", a.0, b.0);
        }
        for (publisher, subscription, heard) in &apart {
            let counts = (publisher.subscriber_count(), subscription.publisher_count());
            assert_eq!(counts, (0, 0), "{} to {}: {}", a.0, b.0, publisher.topic());
            assert!(heard.try_recv().is_err());
        }
    }
}

#[test]
fn samples_of_every_size_arrive_whole() {
    for (a, b) in pairs() {
        let ends = Ends::start(a, b);
        let qos = Qos::reliable(5);
        let publisher = ends.from.publisher::<PointCloud2>("points", qos).unwrap();
        let (sender, heard) = channel();
        let handler = move |message: Arc<PointCloud2>| drop(sender.send(message));
        let subscription =
            ends.to
                .subscribe("points", qos, SubscriptionExecutor::Dedicated, handler);
        let _subscription = subscription.unwrap();
        let (sender, joined) = channel();
        publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).unwrap();
        for bytes in [60_000, 65_536, 500_000, 2_000_000, 8_000_000] {
            let data: Vec<u8> = (0..bytes).map(|i| (i * 31 % 251) as u8).collect();
            let cloud = Arc::new(PointCloud2 {
                data: data.into(),
                ..lattice_test::clouds::cloud("map", 0, &[])
            });
            publisher.publish(Arc::clone(&cloud)).unwrap();
            let heard = heard.recv_timeout(PATIENCE);
            let arrived = heard.is_ok_and(|heard| heard == cloud);
            assert!(arrived, "{} to {}: {bytes} bytes", a.0, b.0);
        }
    }
}

#[test]
fn a_late_joiner_hears_what_is_latched() {
    late_joiner_hears(Qos::latched(3), &["2", "3", "4"]);
}

#[test]
fn a_late_joiner_is_spared_a_history_that_is_not_kept() {
    late_joiner_hears(Qos::latched(3).keeping(1), &["4"]);
}

fn late_joiner_hears(offered: Qos, kept: &[&str]) {
    for (a, b) in pairs() {
        let ends = Ends::start(a, b);
        let publisher = ends.from.publisher("origin", offered).unwrap();
        // The first one makes the publisher serialise.
        let (_first, heard) = hear(&ends.to, "origin", Qos::latched(3));
        let (sender, joined) = channel();
        publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).unwrap();
        for data in ["1", "2", "3", "4"] {
            let data = data.to_owned();
            publisher.publish(RosString { data }).unwrap();
        }
        for data in ["2", "3", "4"] {
            while heard.recv_timeout(PATIENCE).unwrap().data != data {}
        }
        assert!(publisher.flush(PATIENCE));
        let (_late, heard) = hear(&ends.to, "origin", Qos::latched(3));
        for data in kept {
            let word = || heard.recv_timeout(PATIENCE).unwrap().data.clone();
            assert_eq!(word(), *data, "{} to {}", a.0, b.0);
        }
    }
}

#[test]
fn endpoints_of_different_types_do_not_meet() {
    for (a, b) in pairs() {
        let ends = Ends::start(a, b);
        let wrong = ends.from.publisher::<Imu>("chatter", Qos::DEFAULT).unwrap();
        let (subscription, heard) = hear(&ends.to, "chatter", Qos::DEFAULT);
        let (sender, joined) = channel();
        let third = runtime(&ends._domain, a, "third");
        let right = third.node("third").unwrap();
        let right = right.publisher("chatter", Qos::DEFAULT).unwrap();
        right.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).unwrap();
        wrong.publish(Imu::default()).unwrap();
        let data = "right".to_owned();
        right.publish(RosString { data }).unwrap();
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "right");
        let found = (wrong.subscriber_count(), subscription.undecodable());
        assert_eq!(found, (0, 0), "{} to {}", a.0, b.0);
    }
}
