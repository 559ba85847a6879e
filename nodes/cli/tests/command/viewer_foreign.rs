//! The viewer's socket under the authors' own client of the Foxglove protocol, with foreign decoders.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write, stderr};
use std::net::{Ipv4Addr, SocketAddr};
use std::process::{Command, Stdio};
use std::sync::Arc;

use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::geometry_msgs::{Point, TransformStamped};
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::{self, Header};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use lattice_nodes::viewer_server::{Broadcaster, Class, Entry, Identity, RequestAuth, Server, Tls};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Activity, LoopbackDomain, Runtime, SubscriptionExecutor};
use serde_bytes::ByteBuf;
use serde_json::{Map, Value, to_value};

use crate::browser::stage::{Known, map};
use crate::viewer::Viewer;

fn header() -> Header {
    let mut header = Header {
        frame_id: "map".to_owned(),
        ..Header::default()
    };
    (header.stamp.sec, header.stamp.nanosec) = (1_700_000_000, 250_000_000);
    header
}

fn markers() -> MarkerArray {
    let corner = |x| Point { x, y: -0.5, z: 2.0 };
    MarkerArray {
        markers: vec![Marker {
            header: header(),
            ns: "voxels".to_owned(),
            type_: Marker::TRIANGLE_LIST,
            points: [0.25, 0.5, 0.75].map(corner).into(),
            ..Marker::default()
        }],
    }
}

fn cloud() -> PointCloud2 {
    PointCloud2 {
        header: header(),
        height: 1,
        width: 2,
        fields: vec![PointField {
            name: "x".to_owned(),
            datatype: PointField::FLOAT32,
            count: 1,
            ..PointField::default()
        }],
        point_step: 4,
        row_step: 8,
        data: ByteBuf::from([0, 1, 2, 3, 4, 5, 6, 255]),
        is_dense: true,
        ..PointCloud2::default()
    }
}

fn transforms() -> TFMessage {
    let mut transform = TransformStamped {
        header: header(),
        child_frame_id: "base_link".to_owned(),
        ..TransformStamped::default()
    };
    transform.transform.translation.y = -3.5;
    TFMessage {
        transforms: vec![transform],
    }
}

fn known_map() -> LatticeMap {
    map(&[
        Known::new([1, -2, 3], 7, 4),
        Known::new([5, 6, -7], 300, 65_535),
    ])
}

/// A server with one message on each channel, and these messages by their topics.
fn server(identity: Option<&Identity>) -> (Server, Value) {
    let broadcaster = Arc::new(Broadcaster::new(4, Activity::default()));
    let mut all = Map::new();
    let map = known_map();
    broadcaster.channel::<LatticeMap>("/voxel_map", Class::Map, false);
    all.insert("/voxel_map".to_owned(), to_value(&map).unwrap());
    let chunk = Entry {
        stamp_ns: 1,
        cdr: cdr::to_vec(&map).unwrap().into(),
        thin: None,
    };
    broadcaster.change_map(|stream| stream.set_keyframe(vec![chunk]));
    let mut add = |topic: &str, channel: u32, message: Value, cdr: Vec<u8>| {
        broadcaster.offer(channel, cdr);
        all.insert(topic.to_owned(), message);
    };
    macro_rules! kept {
        ($topic:literal, $message:expr) => {{
            let message = $message;
            let channel = channel_of(&broadcaster, $topic, &message);
            let cdr = cdr::to_vec(&message).unwrap();
            add($topic, channel, to_value(&message).unwrap(), cdr);
        }};
    }
    kept!("/voxel_markers", markers());
    kept!("/map_centers", cloud());
    kept!("/tf", transforms());
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = Server::start(
        address,
        RequestAuth::default(),
        identity.map(|identity| identity.config.clone()),
        Arc::clone(&broadcaster),
    )
    .unwrap();
    (server, Value::Object(all))
}

fn channel_of<M: RosMessage>(broadcaster: &Broadcaster, topic: &str, _: &M) -> u32 {
    broadcaster.channel::<M>(topic, Class::Newest { depth: 1 }, true)
}

/// The same with all numbers as floating-point ones, the only kind that JavaScript writes.
fn alike(value: &Value) -> Value {
    match value {
        Value::Number(number) => number.as_f64().into(),
        Value::Array(list) => list.iter().map(alike).collect(),
        Value::Object(fields) => {
            let fields = fields
                .iter()
                .map(|(name, value)| (name.clone(), alike(value)));
            Value::Object(fields.collect())
        }
        other => other.clone(),
    }
}

/// Folder in which `test/node` is installed; else a line says so.
pub fn folder() -> Option<OsString> {
    let folder = std::env::var_os("LATTICE_NODE_PEER");
    if folder.is_none() {
        let problem = "SKIPPED: LATTICE_NODE_PEER names no folder with test/node installed";
        let _ = writeln!(stderr(), "{problem}");
    }
    folder
}

#[test]
fn the_protocols_own_client_reads_every_kind_of_message_by_both_names() {
    let Some(folder) = folder() else { return };
    let state = tempfile::tempdir().unwrap();
    let place = || Ok(state.path().to_owned());
    let identity = Tls::SelfMade.identity(place, &[Ipv4Addr::LOCALHOST.into()]);
    for (scheme, identity) in [("ws", None), ("wss", identity.unwrap())] {
        let (server, messages) = server(identity.as_ref());
        let url = format!("{scheme}://{}", server.address());
        for protocol in ["foxglove.websocket.v1", "foxglove.sdk.v1"] {
            let peer = Command::new("node")
                .args(["foxglove_peer.mjs", &url, protocol])
                .env("NODE_EXTRA_CA_CERTS", state.path().join("viewer_tls.pem"))
                .current_dir(&folder)
                .stderr(Stdio::inherit())
                .output()
                .unwrap();
            assert!(peer.status.success(), "{scheme} {protocol}");
            let said: Value = serde_json::from_slice(&peer.stdout).unwrap();
            assert_eq!(said["protocol"], protocol);
            for (topic, message) in messages.as_object().unwrap() {
                let read = &said["read"][topic];
                assert_eq!(alike(read), alike(message), "{topic} by {protocol}");
            }
        }
        server.finish();
    }
}

/// Takes changes of the graph until it has what is asked for: ids by kind and name, and all that was removed.
fn follow(
    lines: &mut impl Iterator<Item = String>,
    known: &mut Map<String, Value>,
    is_enough: impl Fn(&Map<String, Value>) -> bool,
) {
    while !is_enough(known) {
        let change: Value = serde_json::from_str(&lines.next().unwrap()).unwrap();
        for (kind, ids) in [
            ("publishedTopics", "publisherIds"),
            ("subscribedTopics", "subscriberIds"),
            ("advertisedServices", "providerIds"),
        ] {
            for entry in change[kind].as_array().unwrap() {
                let name = entry["name"].as_str().unwrap();
                known.insert(format!("{kind} {name}"), entry[ids].clone());
            }
        }
        for kind in ["removedTopics", "removedServices"] {
            for name in change[kind].as_array().unwrap() {
                known.insert(format!("{kind} {}", name.as_str().unwrap()), Value::Null);
            }
        }
    }
}

#[test]
fn the_protocols_own_client_sees_nodes_elsewhere_come_and_go() {
    let Some(folder) = folder() else { return };
    let domain = LoopbackDomain::take().unwrap();
    let viewer = Viewer::start_in(&domain, &["view", "--port", "0"]);
    let mut client = Command::new("node")
        .args(["foxglove_graph.mjs", &viewer.url.replace("http", "ws")])
        .current_dir(&folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(client.stdout.take().unwrap()).lines();
    let (lines, mut known) = (&mut lines.map(Result::unwrap), Map::new());
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let args = RosArgs::parse(["--ros-args", "-r", "__ns:=/robot"].map(str::to_owned)).unwrap();
    let runtime = Runtime::with_transport("peer", args, &network).unwrap();
    let node = runtime.node("peer").unwrap();
    let ours = node.publisher::<std_msgs::Empty>("/from_peer", Qos::DEFAULT);
    let heard = |_: Arc<std_msgs::Empty>| {};
    let theirs = node.subscribe(
        "/to_peer",
        Qos::DEFAULT,
        SubscriptionExecutor::Shared,
        heard,
    );
    assert!(ours.is_ok() && theirs.is_ok());
    let peer = ["/robot/peer"].as_slice();
    follow(lines, &mut known, |known| {
        known.get("publishedTopics /from_peer") == Some(&peer.into())
            && known.get("subscribedTopics /to_peer") == Some(&peer.into())
            && known.get("advertisedServices /robot/peer/get_parameters") == Some(&peer.into())
            && known.get("subscribedTopics /voxel_map")
                == Some(&["/viewer_server"].as_slice().into())
    });
    assert!(!known.keys().any(|name| name.starts_with("removed")));
    drop((ours, theirs, node));
    drop(runtime);
    follow(lines, &mut known, |known| {
        known.contains_key("removedTopics /from_peer")
            && known.contains_key("removedTopics /to_peer")
            && known.contains_key("removedServices /robot/peer/get_parameters")
    });
    assert!(!known.contains_key("removedTopics /voxel_map"));
    client.kill().unwrap();
    client.wait().unwrap();
}
