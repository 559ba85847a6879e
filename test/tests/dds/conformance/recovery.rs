//! Peers that are killed, or stopped and continued, are received again.

use std::time::Duration;

use super::{Echo, PATIENCE, RECOVERY, Talk, pairs};
use lattice_test::domain::TestDomain;

#[test]
fn a_peer_that_is_killed_makes_room_for_the_next() {
    for (ours, theirs) in pairs() {
        let domain = TestDomain::take();
        let talk = Talk::start(&domain, ours);
        let first = Echo::start(&domain, theirs);
        talk.until_echoed("first", PATIENCE);
        first.signal("KILL");
        let _second = Echo::start(&domain, theirs);
        let took = talk.until_echoed("second", RECOVERY);
        println!("{} hears a new {} after {took:?}", ours.0, theirs.0);
    }
}

fn stop_and_continue(stopped: Duration) {
    for (ours, theirs) in pairs() {
        let domain = TestDomain::take();
        let talk = Talk::start(&domain, ours);
        let echo = Echo::start(&domain, theirs);
        talk.until_echoed("before", PATIENCE);
        echo.signal("STOP");
        // The time that it is stopped is what is tested.
        std::thread::sleep(stopped);
        echo.signal("CONT");
        let took = talk.until_echoed("after", RECOVERY);
        println!(
            "{} hears {} again after {stopped:?} in {took:?}",
            ours.0, theirs.0
        );
    }
}

#[test]
fn a_peer_that_was_stopped_for_a_second_is_heard_again() {
    stop_and_continue(Duration::from_secs(1));
}

#[test]
#[ignore = "takes minutes"]
fn a_peer_that_was_stopped_beyond_its_lease_is_heard_again() {
    stop_and_continue(Duration::from_secs(15));
    stop_and_continue(Duration::from_secs(45));
}
