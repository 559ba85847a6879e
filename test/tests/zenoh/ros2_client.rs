//! A peer in Rust with an implementation of rmw_zenoh of its own: ros2-client with its Zenoh backend.
//!
//! It knows the type hashes of few types and sends the others with a hash of zeros. It keeps nothing for late joiners.

use std::process::Command;
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use lattice_msgs::RosMessage;
use lattice_msgs::hash_of;
use lattice_msgs::rcl_interfaces::{
    GetParameters, GetParametersRequest, Parameter, ParameterType, SetParameters,
    SetParametersRequest,
};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::{GraphEndpoint, GraphRole, Node, RemotePublisher, Runtime};
use lattice_test::python::{zenoh_peer, zenoh_python};
use serde_bytes::ByteBuf;

use super::mapping::call;
use super::{PATIENCE, Peer, Site, hear, text};

/// Bytes of a large message.
const LARGE: usize = 2 << 20;

/// Hash in place of that of a type that ros2-client does not know.
const NO_HASH: &str = "RIHS01_0000000000000000000000000000000000000000000000000000000000000000";

/// A router, the node `/ours` and the peer.
struct Meeting {
    peer: Peer,
    node: Node,
    runtime: Runtime,
    _site: Site,
}

impl Meeting {
    /// None: a program is missing.
    fn start() -> Option<Self> {
        let (python, program) = (zenoh_python()?, zenoh_peer()?);
        let site = Site::start(&python);
        let runtime = site.runtime("ours");
        let node = runtime.node("ours").unwrap();
        // ros2-client drops what a full link does not take within 50 ms by default; on a loaded machine that is a large
        // message.
        let connect = format!(
            "connect/endpoints=[\"{}\"];transport/link/tx/queue/congestion_control/drop=\
             {{wait_before_drop:10000000,max_wait_before_drop_fragments:10000000}}",
            site.endpoint
        );
        let mut command = Command::new(program);
        command.arg(site.domain.id().to_string());
        command.env("ZENOH_CONFIG_OVERRIDE", connect);
        let mut peer = Peer::spawn(&mut command);
        assert_eq!(peer.line(), "ready\n");
        assert_eq!(peer.ask("found /ours"), "done");
        Some(Self {
            peer,
            node,
            runtime,
            _site: site,
        })
    }

    /// Commands that return nothing.
    fn tell(&mut self, lines: &[&str]) {
        for line in lines {
            assert_eq!(self.peer.ask(line), "done", "{line}");
        }
    }

    /// Waits for the publisher of a topic as announced by the peer.
    fn announced(&self, topic: &str) -> RemotePublisher {
        let start = Instant::now();
        loop {
            let all = self.node.remote_publishers();
            match all.into_iter().find(|found| found.topic == topic) {
                Some(found) => return found,
                None => std::thread::yield_now(),
            }
            assert!(start.elapsed() < PATIENCE, "{topic} is not announced");
        }
    }
}

/// Completes with the first subscriber of a publisher.
macro_rules! joined {
    ($publisher:expr) => {{
        let (sender, joined) = channel();
        $publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        joined
    }};
}

fn wait(joined: &Receiver<()>) {
    joined.recv_timeout(PATIENCE).unwrap();
}

#[test]
fn strings_are_exchanged_and_each_sees_the_other_in_the_graph() {
    let Some(mut meeting) = Meeting::start() else {
        return;
    };
    let chatter = meeting
        .node
        .publisher("/chatter", Qos::reliable(7))
        .unwrap();
    let joined = joined!(chatter);
    let (subscription, heard) = hear::<RosString>(&meeting.node, "/heard", Qos::reliable(10));
    meeting.tell(&["hear /chatter reliable", "advertise /heard reliable"]);
    wait(&joined);
    for i in 0..3 {
        chatter.publish(text(i)).unwrap();
    }
    let mut gids = Vec::new();
    for i in 0..3 {
        let taken = meeting.peer.ask("take /chatter");
        let [number, gid, data] = taken.split(' ').collect::<Vec<_>>()[..] else {
            panic!("{taken}");
        };
        assert_eq!((number, data), (&*(i + 1).to_string(), &*i.to_string()));
        gids.push(gid.to_owned());
    }
    gids.dedup();
    assert_eq!((gids.len(), gids[0].len()), (1, 32), "{gids:?}");
    meeting.tell(&["subscribed /heard", "say /heard one", "say /heard two"]);
    for data in ["one", "two"] {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, data);
    }
    assert_eq!(subscription.lost_on_network(), 0);
    assert_eq!(subscription.undecodable(), 0);
    assert_eq!(meeting.peer.ask("counts /chatter"), "1 1");
    assert_eq!(meeting.peer.ask("counts /heard"), "1 1");

    let hash = hash_of(RosString::TYPE).map(str::to_owned);
    let expected = RemotePublisher {
        topic: "/heard".to_owned(),
        type_name: RosString::TYPE.to_owned(),
        type_hash: hash,
        reliability: Reliability::Reliable,
        durability: Durability::Volatile,
    };
    assert_eq!(meeting.announced("/heard"), expected);
    let graph = meeting.node.graph();
    for (role, name) in [
        (GraphRole::Publisher, "/heard"),
        (GraphRole::Subscriber, "/chatter"),
        (GraphRole::Server, "/peer/get_parameters"),
    ] {
        let endpoint = GraphEndpoint {
            role,
            name: name.to_owned(),
            node: "/peer".to_owned(),
        };
        assert!(graph.contains(&endpoint), "{endpoint:?}: {graph:?}");
    }
    // Each end of a session is seen by the other.
    let Meeting {
        mut peer,
        node,
        runtime,
        _site: site,
    } = meeting;
    let late = site.runtime("late");
    let late_node = late.node("late").unwrap();
    let (late_heard, _) = hear::<RosString>(&late_node, "/heard", Qos::reliable(10));
    while late_heard.publisher_count() == 0 {
        std::thread::yield_now();
    }
    drop((subscription, chatter, node, runtime));
    assert_eq!(peer.ask("lost /ours"), "done");
    assert_eq!(peer.ask("counts /chatter"), "0 1");
    peer.finish();
    while late_heard.publisher_count() > 0 {
        std::thread::yield_now();
    }
}

#[test]
fn large_messages_are_exchanged() {
    let Some(mut meeting) = Meeting::start() else {
        return;
    };
    let clouds = meeting.node.publisher("/clouds", Qos::reliable(3)).unwrap();
    let (subscription, heard) = hear::<RosString>(&meeting.node, "/large", Qos::reliable(3));
    meeting.tell(&["hear_cloud /clouds reliable", "advertise /large reliable"]);
    // Its subscription takes any hash, but announces that of zeros: only Zenoh knows that it matches.
    while clouds.subscriber_count() == 0 {
        std::thread::yield_now();
    }
    let cloud = PointCloud2 {
        height: 1,
        width: 1000,
        data: ByteBuf::from(vec![3; LARGE]),
        ..PointCloud2::default()
    };
    clouds.publish(cloud).unwrap();
    let taken = meeting.peer.ask("take /clouds");
    let expected = format!(" 1000 {LARGE} {}", 3 * LARGE);
    assert!(
        taken.starts_with("1 ") && taken.ends_with(&expected),
        "{taken}"
    );
    meeting.tell(&["subscribed /large"]);
    meeting.tell(&[&format!("say_long /large {LARGE}")]);
    let long = heard.recv_timeout(PATIENCE).unwrap();
    assert!(long.data.len() == LARGE && long.data.bytes().all(|byte| byte == b'x'));
    assert_eq!(subscription.undecodable(), 0);
}

#[test]
fn a_type_whose_hash_ros2_client_does_not_know_is_heard_and_not_received() {
    let Some(mut meeting) = Meeting::start() else {
        return;
    };
    let (subscription, heard) = hear::<PointCloud2>(&meeting.node, "/clouds", Qos::reliable(3));
    let _reset = meeting
        .node
        .service_trigger("~/reset", || (true, "done".to_owned()));
    meeting.tell(&["advertise_cloud /clouds reliable", "subscribed /clouds"]);
    let announced = meeting.announced("/clouds");
    assert_eq!(announced.type_name, PointCloud2::TYPE);
    assert_eq!(announced.type_hash.as_deref(), Some(NO_HASH));
    // A key with another hash is another key.
    meeting.tell(&["say_cloud /clouds 100"]);
    assert_eq!(
        meeting.peer.ask("trigger /ours/reset"),
        "service: no reply received"
    );
    assert!(heard.try_recv().is_err());
    assert_eq!(subscription.publisher_count(), 0);
}

#[test]
fn parameters_are_served_both_ways() {
    let Some(mut meeting) = Meeting::start() else {
        return;
    };
    let speed = |node: &Node| {
        let names = vec!["speed".to_owned()];
        let request = GetParametersRequest { names };
        let response = call::<GetParameters>(node, "/peer/get_parameters", &request);
        assert_eq!(
            response.values[0].type_,
            ParameterType::PARAMETER_DOUBLE,
            "{response:?}"
        );
        response.values[0].double_value
    };
    assert_eq!(speed(&meeting.node), 1.0);
    let mut parameter = Parameter {
        name: "speed".to_owned(),
        ..Parameter::default()
    };
    parameter.value.type_ = ParameterType::PARAMETER_DOUBLE;
    parameter.value.double_value = 2.5;
    let parameters = vec![parameter];
    let request = SetParametersRequest { parameters };
    let set = call::<SetParameters>(&meeting.node, "/peer/set_parameters", &request);
    assert!(set.results[0].successful, "{set:?}");
    assert_eq!(speed(&meeting.node), 2.5);

    let count = meeting.node.params().declared().len();
    assert_eq!(meeting.peer.ask("list /ours"), count.to_string());
    let get = "get /ours use_sim_time";
    assert_eq!(meeting.peer.ask(get), "Some(Boolean(false))");
    let refused = meeting.peer.ask("set /ours use_sim_time 1.5");
    assert!(refused.starts_with("Some(Err("), "{refused}");
    assert!(refused.contains("use_sim_time"), "{refused}");
}

#[test]
fn qos_is_read_from_tokens_and_latched_topics_lack_history() {
    let Some(mut meeting) = Meeting::start() else {
        return;
    };
    for (profile, reliability, durability) in [
        ("reliable", Reliability::Reliable, Durability::Volatile),
        ("best_effort", Reliability::BestEffort, Durability::Volatile),
        ("latched", Reliability::Reliable, Durability::TransientLocal),
        ("all", Reliability::BestEffort, Durability::TransientLocal),
    ] {
        meeting.tell(&[&format!("advertise /{profile} {profile}")]);
        let announced = meeting.announced(&format!("/{profile}"));
        assert_eq!(announced.reliability, reliability, "{profile}");
        assert_eq!(announced.durability, durability, "{profile}");
    }
    // A subscription that asks for history receives only new messages.
    let (_subscription, heard) = hear::<RosString>(&meeting.node, "/latched", Qos::LATCHED);
    meeting.tell(&["subscribed /latched", "say /latched live"]);
    assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "live");
    let map_name = meeting.node.publisher("/map_name", Qos::LATCHED).unwrap();
    map_name.publish(text("old")).unwrap();
    assert!(map_name.flush(PATIENCE));
    let joined = joined!(map_name);
    meeting.tell(&["hear /map_name latched"]);
    wait(&joined);
    map_name.publish(text("new")).unwrap();
    let taken = meeting.peer.ask("take /map_name");
    assert!(taken.ends_with(" new"), "{taken}");
}
