//! Peers of ours without a router: by multicast, and by endpoints that are named.

use lattice_msgs::std_msgs::String as RosString;
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
