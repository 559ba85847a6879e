//! A peer in Python that keeps the conventions of rmw_zenoh by itself: keys, tokens, attachments, gids.

use std::sync::mpsc::channel;

use lattice_msgs::std_msgs::String as RosString;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_msgs::{RosMessage, RosService, cdr, hash_of};
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::{GraphEndpoint, GraphRole, RemotePublisher};
use lattice_test::python::zenoh_python;
use serde_json::{Value, json};

use super::{PATIENCE, Peer, Site, hear, runtime, text};

/// Last parts of a token.
fn token(name: &str, of: [&str; 2], qos: &str) -> Value {
    let name = name.replace('/', "%");
    json!([name, of[0], of[1], qos])
}

#[test]
fn a_peer_by_the_book_hears_and_is_heard_and_its_rubbish_is_counted() {
    let Some(python) = zenoh_python() else { return };
    let site = Site::start(&python);
    // A message of 2 MB is too long for this node.
    let ours = runtime("ours", &["max_message_bytes:=1048576"], &site.network());
    let node = ours.node("ours").unwrap();
    let latched = node.publisher("/latched_by_ours", Qos::LATCHED).unwrap();
    for data in ["gone", "kept"] {
        latched.publish(text(data)).unwrap();
    }
    let chatter = node.publisher("/chatter", Qos::reliable(7)).unwrap();
    let (sender, joined) = channel();
    chatter.on_subscriber_joined(move || {
        let _ = sender.send(());
    });
    let _reset = node.service_trigger("~/reset", || (true, "done".to_owned()));
    let (subscription, heard) = hear::<RosString>(&node, "/heard", Qos::reliable(10));
    let mut peer = Peer::start(
        &python,
        &["meet", &site.endpoint, &site.domain.id().to_string()],
    );
    joined.recv_timeout(PATIENCE).unwrap();
    for i in 0..3 {
        chatter.publish(text(i)).unwrap();
    }
    for data in [
        "one", "two", "eight", "again", "old", "nine", "other", "gap",
    ] {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, data);
    }
    // What the peer had said before this subscription was there.
    let (_latched, late) = hear::<RosString>(&node, "/latched_by_peer", Qos::LATCHED);
    assert_eq!(late.recv_timeout(PATIENCE).unwrap().data, "kept");
    let client = node.client::<Trigger>("/peer/trigger").unwrap();
    let request = cdr::to_vec(&TriggerRequest::default()).unwrap();
    let answer = smol::block_on(client.call(request.clone(), PATIENCE)).unwrap();
    let expected = TriggerResponse {
        success: true,
        message: "peer".to_owned(),
    };
    assert_eq!(
        cdr::from_slice::<TriggerResponse>(&answer).unwrap(),
        expected
    );

    let found: Value = serde_json::from_str(&peer.line()).unwrap();
    let string = [
        "std_msgs::msg::dds_::String_",
        hash_of(RosString::TYPE).unwrap(),
    ];
    let trigger = [
        "std_srvs::srv::dds_::Trigger_",
        hash_of(Trigger::TYPE).unwrap(),
    ];
    assert_eq!(
        found["latched_token"],
        token("/latched_by_ours", string, ":1:,1:,:,:,,")
    );
    assert_eq!(
        found["chatter_token"],
        token("/chatter", string, "::,7:,:,:,,")
    );
    assert_eq!(
        found["service_token"],
        token("/ours/reset", trigger, "::,10:,:,:,,")
    );
    // Number of the sample, and whether its gid is that of the token.
    assert_eq!(found["latched"], json!(["kept", 2, true]));
    let chatter = json!([["0", 1, true], ["1", 2, true], ["2", 3, true]]);
    assert_eq!(found["chatter"], chatter);
    let reply = TriggerResponse {
        success: true,
        message: "done".to_owned(),
    };
    let hex = |bytes: Vec<u8>| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    assert_eq!(
        found["reply"],
        json!([hex(cdr::to_vec(&reply).unwrap()), 7, true])
    );
    assert_eq!(found["asked"], json!([1, true, hex(request)]));
    assert_eq!(found["rubbish_replies"], json!([0, 0]));

    let of_peer = |role, name: &str| GraphEndpoint {
        role,
        name: name.to_owned(),
        node: "/peer".to_owned(),
    };
    let graph = node.graph();
    for endpoint in [
        of_peer(GraphRole::Publisher, "/heard"),
        of_peer(GraphRole::Subscriber, "/chatter"),
        of_peer(GraphRole::Server, "/peer/trigger"),
    ] {
        assert!(
            graph.contains(&endpoint),
            "{endpoint:?} is not in {graph:?}"
        );
    }
    let publisher = RemotePublisher {
        topic: "/latched_by_peer".to_owned(),
        type_name: RosString::TYPE.to_owned(),
        type_hash: Some(string[1].to_owned()),
        reliability: Reliability::Reliable,
        durability: Durability::TransientLocal,
    };
    assert!(node.remote_publishers().contains(&publisher));
    assert_eq!(subscription.publisher_count(), 2);
    // 5 to 7 of the one, 1001 of the other.
    assert_eq!(subscription.lost_on_network(), 4);
    // Nameless, short, without gid, too long, empty: all between those that were heard.
    assert_eq!(subscription.undecodable(), 5);
    peer.finish();
    while subscription.publisher_count() > 0 {
        std::thread::yield_now();
    }
    drop(latched);
}
