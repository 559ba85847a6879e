//! A peer that was stopped for longer than its lease, as by Ctrl-Z or a debugger.

use std::process::Command;
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::SubscriptionExecutor;
use lattice_runtime::qos::Qos;
use lattice_test::domain::TestDomain;
use lattice_test::python::{python, script};

use super::{PATIENCE, assert_heard, hear, runtime, text, wait_until};
use crate::conformance::Echo;

#[test]
fn a_cyclone_peer_that_stalled_beyond_its_lease_hears_and_is_heard_again() {
    let Some(python) = python() else { return };
    let start = |domain: &TestDomain| {
        let mut command = Command::new(python);
        command
            .arg(script("echo_peer.py"))
            .arg(domain.id().to_string());
        Echo(command.spawn().unwrap())
    };
    // Its lease is 10 s.
    stop_and_go(start, Duration::from_secs(15));
}

fn stop_and_go(start: impl FnOnce(&TestDomain) -> Echo, stop: Duration) {
    let domain = TestDomain::take();
    let us = runtime(&domain, "us", &[]);
    let node = us.node("us").unwrap();
    let talk = node
        .publisher::<RosString>("/heard", Qos::reliable(10))
        .unwrap();
    let (joined, joins) = channel();
    talk.on_subscriber_joined(move || joined.send(()).unwrap());
    let (said, repeated) = hear::<RosString>(
        &node,
        "/said",
        Qos::reliable(10),
        SubscriptionExecutor::Shared,
    );
    let (again, back) = channel();
    said.on_publisher_joined(move || again.send(()).unwrap());
    let (_map, maps) =
        hear::<RosString>(&node, "/map", Qos::latched(1), SubscriptionExecutor::Shared);
    let phrase = Arc::new(Mutex::new(String::new()));
    let (spoken, speaker) = (Arc::clone(&phrase), talk.clone());
    let _timer = us.timer(Duration::from_millis(50), move || {
        speaker.publish(text(spoken.lock().unwrap())).unwrap();
    });
    let echo = start(&domain);
    let round = |data: &str| {
        joins.recv_timeout(PATIENCE).expect("a subscriber");
        back.recv_timeout(PATIENCE).expect("a publisher");
        // The other side may not know of us yet, so it is told again and again.
        data.clone_into(&mut phrase.lock().unwrap());
        while repeated.recv_timeout(PATIENCE).unwrap().data != data {}
        assert_heard(&maps, "map");
    };
    round("before");
    echo.signal("STOP");
    std::thread::sleep(stop);
    echo.signal("CONT");
    let continued = Instant::now();
    round("after");
    // The participant that was has taken its leave.
    wait_until(&us, move || {
        talk.subscriber_count() == 1 && said.publisher_count() == 1
    });
    let took = continued.elapsed();
    assert!(took < Duration::from_secs(12), "{took:?}");
}
