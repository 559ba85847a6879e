//! Peers of ours without a router: by multicast, and by endpoints that are named; and who is off, whatever is named.

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_test::domain::TestDomain;

use super::{PATIENCE, free_endpoint, hear, network, runtime, text};

/// A late joiner receives latched messages.
fn meet(first: &str, second: &str) {
    let domain = TestDomain::take();
    let from = runtime("from", &[], &network(&domain, first, "-1"));
    let from = from.node("from").unwrap();
    let map = from.publisher("/map_name", Qos::LATCHED).unwrap();
    map.publish(text("kept")).unwrap();
    let to = runtime("to", &[], &network(&domain, second, "-1"));
    let to = to.node("to").unwrap();
    let (_subscription, heard) = hear::<RosString>(&to, "/map_name", Qos::LATCHED);
    assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "kept");
}

#[test]
fn peers_meet_at_an_endpoint_that_is_named() {
    let endpoint = free_endpoint();
    meet(
        &format!("connect/endpoints=[];listen/endpoints=[\"{endpoint}\"]"),
        &format!("connect/endpoints=[\"{endpoint}\"]"),
    );
}

#[test]
fn peers_meet_by_multicast_where_it_is_switched_on() {
    // A group of this test's own.
    let port = free_endpoint()
        .rsplit(':')
        .next()
        .map(str::to_owned)
        .unwrap();
    let scouting = format!(
        "connect/endpoints=[];scouting/multicast/enabled=true;scouting/multicast/interface=\"lo\";\
         scouting/multicast/address=\"224.0.0.224:{port}\""
    );
    meet(&scouting, &scouting);
}

#[test]
fn who_is_off_is_found_by_nobody() {
    let domain = TestDomain::take();
    let (endpoint, of_off) = (free_endpoint(), free_endpoint());
    let listens = format!("connect/endpoints=[];listen/endpoints=[\"{endpoint}\"]");
    let calls = format!("connect/endpoints=[\"{endpoint}\",\"{of_off}\"]");
    let from = runtime("from", &[], &network(&domain, &listens, "-1"));
    let from = from.node("from").unwrap();
    let map = from.publisher("/map_name", Qos::LATCHED).unwrap();
    map.publish(text("kept")).unwrap();
    // Two that are off: one that would call, and one that would be called.
    let off = [&calls, &format!("listen/endpoints=[\"{of_off}\"]")].map(|overrides| {
        let network = Network {
            discovery_off: true,
            ..network(&domain, overrides, "-1")
        };
        let runtime = runtime("off", &[], &network);
        let node = runtime.node("off").unwrap();
        let heard = hear::<RosString>(&node, "/map_name", Qos::LATCHED);
        (heard, node, runtime)
    });
    // Of several that come later each has met the first before anybody could have met those.
    for number in 1..=5 {
        let to = runtime("to", &[], &network(&domain, &calls, "-1"));
        let to = to.node("to").unwrap();
        let (_subscription, heard) = hear::<RosString>(&to, "/map_name", Qos::LATCHED);
        assert_eq!(
            heard.recv_timeout(PATIENCE).unwrap().data,
            "kept",
            "{number}"
        );
    }
    for ((subscription, heard), node, _runtime) in &off {
        assert!(heard.try_recv().is_err());
        assert_eq!(subscription.publisher_count(), 0);
        assert!(node.remote_publishers().is_empty());
    }
}
