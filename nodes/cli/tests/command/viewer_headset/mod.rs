//! A headset with the Foxglove protocol over the viewer's socket: its clouds are calibrated, and it receives the
//! answer.

mod client;
mod scene;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use async_tungstenite::tungstenite::Message;
use lattice_msgs::cdr;
use lattice_msgs::lattice::{CalibrateRequest, CalibrateResponse, CalibrationResult};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::LoopbackDomain;
use serde_json::{Value, json};

use self::client::Client;
use self::scene::{FRAME, Headset, SECOND_NS, Told};
use crate::PATIENCE;
use crate::viewer::Viewer;
use crate::viewer_foreign::folder;

/// Parameters of all nodes in one process: the mapper continues the map.
fn params(folder: &Path) -> String {
    let dir = folder.display();
    let text = format!(
        "/**/lattice_mapper:\n  ros__parameters: {{lattice: cubic, cell_volume_m3: 0.000125, keep_labels: true, map_dir: \
         '{dir}', autosave_file: house.lattice, resume: true}}\n\
         /**/headset_cloud:\n  ros__parameters: {{stride: 1}}\n\
         /**/semantic_icp_server:\n  ros__parameters: {{headset_axes: ros_flu}}\n\
         /**/viewer_server:\n  ros__parameters: {{allow_headset: true, headset_message_bytes: 1000000}}\n"
    );
    let path = folder.join("nodes.yaml");
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn a_headset_on_the_socket_is_calibrated_and_told_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let headset = Headset::new(folder.path());
    let domain = LoopbackDomain::take().unwrap();
    let params = params(folder.path());
    let viewer = Viewer::start_in(&domain, &["view", &params, "--port", "0"]);
    let mut client = Client::connect(&viewer.url);
    client.subscribe(&["/calibration", "/tf"]);
    let mesh = headset
        .first
        .iter()
        .find(|told| told.topic == "/headset/mesh");
    assert!(
        mesh.unwrap().cdr.len() > 64 << 10,
        "above the limit of others"
    );
    headset.first.iter().for_each(|told| client.publish(told));
    let mut stamp_ns = SECOND_NS;
    let look = |client: &mut Client| {
        stamp_ns += SECOND_NS / 2;
        let look = headset.look(stamp_ns);
        look.iter().for_each(|told| client.publish(told));
    };
    let result = client.until("/calibration", look, |result: CalibrationResult| {
        (result.verdict == CalibrationResult::OK).then_some(result)
    });
    let [m, deg] = headset.off(&result.transform);
    assert!(m < 0.15 && deg < 3.0, "{m} m, {deg} degrees off");
    assert_eq!(result.session, "this morning");
    let found = client.until(
        "/tf",
        |_| (),
        |message: TFMessage| {
            let mut all = message.transforms.into_iter();
            all.find(|transform| transform.child_frame_id == FRAME)
        },
    );
    assert_eq!(found.header.frame_id, "map");
    let [m, deg] = headset.off(&found.transform);
    assert!(m < 0.15 && deg < 3.0, "{m} m, {deg} degrees off");
    ask_for_a_calibration(&mut client);
    hostile(client, &viewer.url);
}

/// Asks by the service.
fn ask_for_a_calibration(client: &mut Client) {
    let request = cdr::to_vec(&CalibrateRequest::default()).unwrap();
    let service = client.service.as_u64().unwrap() as u32;
    let mut call = vec![2];
    for number in [service, 77, 3] {
        call.extend(number.to_le_bytes());
    }
    call.extend(b"cdr");
    call.extend(request);
    client.socket.send(Message::Binary(call.into())).unwrap();
    let late = Instant::now() + PATIENCE;
    loop {
        assert!(Instant::now() < late, "no answer");
        match client.next() {
            Some(Message::Binary(bytes)) if bytes[0] == 3 => {
                assert_eq!(bytes[5..9], 77_u32.to_le_bytes());
                let answer: CalibrateResponse = cdr::from_slice(&bytes[16..]).unwrap();
                assert_eq!(answer.result.session, "this morning");
                return;
            }
            Some(Message::Text(text)) => assert!(!text.contains("serviceCallFailure"), "{text}"),
            _ => {}
        }
    }
}

/// Messages that cannot be taken: each is reported and counted, and the next client is served.
fn hostile(mut client: Client, url: &str) {
    let mesh = client
        .mine
        .iter()
        .position(|topic| *topic == "/headset/mesh");
    client.send(mesh.unwrap() as u32, &[0, 1, 0, 0, 255, 255, 255, 255]);
    let said = text_within(&mut client);
    assert!(said.contains("not a message of the type"), "{said}");
    for (id, topic, type_name) in [
        (90, "/cmd_vel", "geometry_msgs/msg/Twist"),
        (91, "/headset/mesh", "std_msgs/msg/String"),
        (92, "/voxel_map", "lattice_msgs/msg/LatticeMap"),
    ] {
        let channel = json!({"id": id, "topic": topic, "encoding": "cdr", "schemaName": type_name});
        client.say(&json!({"op": "advertise", "channels": [channel]}));
        let said = text_within(&mut client);
        assert!(said.contains("is rejected"), "{topic}: {said}");
    }
    client.send(mesh.unwrap() as u32, &vec![0; 1_100_000]);
    let late = Instant::now() + PATIENCE;
    let close = loop {
        assert!(Instant::now() < late, "the connection goes on");
        if let Some(Message::Close(close)) = client.next() {
            break close.unwrap();
        }
    };
    let reason = close.reason.as_str();
    assert!(reason.contains("headset_message_bytes"), "{reason}");
    let mut next = Client::connect(url);
    next.subscribe(&["/diagnostics"]);
    next.until_counted("headset_malformed", "1");
    next.until_counted("headset_too_long", "1");
}

/// The next text.
fn text_within(client: &mut Client) -> String {
    let late = Instant::now() + PATIENCE;
    loop {
        assert!(Instant::now() < late, "no text");
        if let Some(Message::Text(text)) = client.next() {
            return text.to_string();
        }
    }
}

#[test]
fn the_protocols_own_client_publishes_for_a_headset() {
    let Some(node) = folder() else { return };
    let folder = tempfile::tempdir().unwrap();
    let headset = Headset::new(folder.path());
    let list = |all: &[Told]| -> Vec<Value> {
        let message = |told: &Told| {
            json!({"topic": told.topic, "schemaName": told.type_name, "schema": told.schema,
                "message": told.json})
        };
        all.iter().map(message).collect()
    };
    let looks = (1..60).map(|i| list(&headset.look((i + 2) * SECOND_NS / 2)));
    let scenario = json!({"first": list(&headset.first), "looks": looks.collect::<Vec<_>>()});
    let path = folder.path().join("scenario.json");
    std::fs::write(&path, scenario.to_string()).unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let params = params(folder.path());
    let viewer = Viewer::start_in(&domain, &["view", &params, "--port", "0"]);
    let peer = Command::new("node")
        .args(["foxglove_headset.mjs", &viewer.url.replace("http", "ws")])
        .arg(&path)
        .current_dir(&node)
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    assert!(peer.status.success());
    let said: CalibrationResult = serde_json::from_slice(&peer.stdout).unwrap();
    let [m, deg] = headset.off(&said.transform);
    assert!(m < 0.15 && deg < 3.0, "{m} m, {deg} degrees off");
}
