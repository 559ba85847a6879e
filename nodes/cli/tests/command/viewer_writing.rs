//! Changes through the page: off unless they are allowed, and asked for first.

use std::io::BufReader;
use std::net::TcpStream;
use std::path::Path;

use async_tungstenite::tungstenite::client::IntoClientRequest;
use async_tungstenite::tungstenite::stream::MaybeTlsStream;
use async_tungstenite::tungstenite::{Message, WebSocket, connect};
use lattice_bag::BagReader;
use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::MapContents;
use lattice_runtime::LoopbackDomain;
use serde_json::{Value, json};

use crate::browser::{chromium, devtools::Page};
use crate::nodes::simulated;
use crate::record;
use crate::viewer::{COMPLETE, Viewer, keys, map_of, scene, shown};

/// Between two layers of centres.
const BOX_END_M: f64 = 0.1;

/// Parameters of a mapper that continues a map, and of a viewer.
fn params(folder: &Path, map: &str, allow_write: bool) -> String {
    std::fs::copy(map, folder.join("site.lattice")).unwrap();
    let dir = folder.display();
    let text = format!(
        "/**/lattice_mapper:\n  ros__parameters: {{lattice: fcc, cell_volume_m3: 0.125, map_dir: \
         '{dir}', autosave_file: site.lattice, resume: true}}\n\
         /**/viewer_server:\n  ros__parameters: {{allow_write: {allow_write}}}\n"
    );
    let path = folder.join("nodes.yaml");
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

pub type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

pub fn socket(url: &str) -> Socket {
    let mut request = url.replace("http", "ws").into_client_request().unwrap();
    let protocol = "foxglove.websocket.v1".parse().unwrap();
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    connect(request).unwrap().0
}

/// The next text message of this kind.
pub fn text(socket: &mut Socket, op: &str) -> Value {
    loop {
        if let Message::Text(text) = socket.read().unwrap() {
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["op"] == op {
                return message;
            }
        }
    }
}

/// Capabilities and services that the server advertises, and its answer to a call of another one.
fn offered(url: &str) -> (Value, Vec<String>, Value) {
    let mut socket = socket(url);
    let call = [
        &[2, 4, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0][..],
        b"cdr",
        &[0, 1, 0, 0, 0],
    ];
    socket.send(Message::Binary(call.concat().into())).unwrap();
    let capabilities = text(&mut socket, "serverInfo")["capabilities"].clone();
    let services = text(&mut socket, "advertiseServices")["services"].clone();
    let names = services.as_array().unwrap().iter();
    let names = names.map(|of| of["name"].as_str().unwrap().to_owned());
    let refused = text(&mut socket, "serviceCallFailure");
    (capabilities, names.collect(), refused)
}

#[test]
fn who_watches_parameters_hears_what_others_set() {
    let folder = tempfile::tempdir().unwrap();
    let (_, params) = site(folder.path());
    let domain = LoopbackDomain::take().unwrap();
    let viewer = Viewer::start_in(&domain, &["view", &params, "--port", "0"]);
    let [mut watching, mut setting] = [(), ()].map(|()| socket(&viewer.url));
    let capabilities = text(&mut watching, "serverInfo")["capabilities"].clone();
    let watched = json!("parametersSubscribe");
    assert!(capabilities.as_array().unwrap().contains(&watched));
    let say = |socket: &mut Socket, message: Value| {
        socket
            .send(Message::Text(message.to_string().into()))
            .unwrap();
    };
    let [period, centers] =
        ["update_period_s", "centers_period_s"].map(|name| format!("/lattice_mapper.{name}"));
    say(
        &mut watching,
        json!({"op": "subscribeParameterUpdates", "parameterNames": [period]}),
    );
    // An answer to the same client says that it is heard.
    say(
        &mut watching,
        json!({"op": "getParameters", "parameterNames": [period], "id": "first"}),
    );
    assert_eq!(text(&mut watching, "parameterValues")["id"], "first");
    for (name, value) in [(&centers, 2.5), (&period, 0.25)] {
        let parameters = json!([{"name": name, "value": value}]);
        say(
            &mut setting,
            json!({"op": "setParameters", "parameters": parameters, "id": name}),
        );
        assert_eq!(text(&mut setting, "parameterValues")["id"], **name);
    }
    let heard = text(&mut watching, "parameterValues");
    let expected = json!([{"name": period, "value": 0.25, "type": "float64"}]);
    assert_eq!(
        (&heard["parameters"], &heard["id"]),
        (&expected, &Value::Null)
    );
}

#[test]
fn without_leave_nothing_is_offered_that_changes_something() {
    let folder = tempfile::tempdir().unwrap();
    let map = map_of(&scene(folder.path(), 5.0), "fcc");
    let params = params(folder.path(), &map, false);
    let domain = LoopbackDomain::take().unwrap();
    let viewer = Viewer::start_in(&domain, &["view", &params, "--port", "0"]);
    let (capabilities, services, refused) = offered(&viewer.url);
    assert_eq!(
        (&refused["serviceId"], &refused["callId"]),
        (&json!(4), &json!(9))
    );
    assert_eq!(capabilities, json!(["services", "connectionGraph"]));
    let reading = [
        "lattice_mapper/query",
        "lattice_mapper/plan_path",
        "bag_player/is_paused",
        "bag_player/get_rate",
    ];
    assert_eq!(services, reading.map(|name| format!("/{name}")));
}

/// Clears the corner of the map through the page; the box is one that the test knows cells of.
fn clear_a_box(page: &mut Page) -> (u64, u64) {
    page.wait_for(&format!("{COMPLETE} && lattice.state.size > 1000"));
    page.wait_for("!document.getElementById('write').hidden");
    let before = page.value("lattice.state.size").as_u64().unwrap();
    page.value("document.getElementById('clear').click()");
    assert_eq!(page.value("document.getElementById('ask').open"), true);
    // No is no, and what the browser still tells of that dialog answers no later one.
    let closed = page.value(
        "(() => { document.querySelector('#ask [type=button]').click(); \
         const closed = !document.getElementById('ask').open; \
         document.getElementById('clear').click(); return closed; })()",
    );
    assert_eq!(closed, true);
    // Chromium tells of it at the next frame.
    page.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))");
    assert_eq!(page.value("document.getElementById('ask').open"), true);
    for (end, plane, height) in [("from", -20.0, -200.0), ("to", BOX_END_M, 200.0)] {
        for (axis, value) in [("x", plane), ("y", plane), ("z", height)] {
            page.value(&format!(
                "document.getElementById('box-{end}-{axis}').value = {value}"
            ));
        }
    }
    assert_eq!(
        page.value("lattice.state.size").as_u64(),
        Some(before),
        "not asked yet"
    );
    page.value("document.querySelector('#ask .do').click()");
    page.wait_for("/cleared/.test(document.getElementById('said').textContent)");
    let said = page.value("document.getElementById('said').textContent.replace(',', '')");
    let cleared = said
        .as_str()
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    page.wait_for(&format!("lattice.state.size === {}", before - cleared));
    (before, cleared)
}

/// Keys of a map whose centres lie there, as the page names them.
fn in_the_box(map: &str) -> Vec<String> {
    let file = std::fs::File::open(map).unwrap();
    let map = MapContents::read(BufReader::new(file), 1 << 20).unwrap();
    let list = map.into_list(usize::MAX);
    let inside = |key: &MortonKey| {
        let centre = list.lattice().center(key.unpack());
        centre.x < BOX_END_M && centre.y < BOX_END_M
    };
    let voxels = list.sorted();
    let keys = voxels.iter().map(|(key, _)| *key).filter(inside);
    let mut keys: Vec<String> = keys.map(|key| key.raw().to_string()).collect();
    keys.sort();
    keys
}

/// A map, and parameters of nodes that may be written to.
pub fn site(folder: &Path) -> (String, String) {
    let map = map_of(&scene(folder, 5.0), "fcc");
    let params = params(folder, &map, true);
    (map, params)
}

/// Clears and saves; what the mapper has then is what the page shows, and the map without the box.
fn clear_and_save(page: &mut Page, folder: &Path, map: &str) {
    let all = keys(map);
    let (before, cleared) = clear_a_box(page);
    assert_eq!((before, cleared > 100), (all.len() as u64, true));
    page.value("document.getElementById('save').click()");
    page.value("document.getElementById('save-name').value = 'after.lattice'");
    page.value("document.querySelector('#ask .do').click()");
    page.wait_for("/saved/.test(document.getElementById('said').textContent)");
    let after = keys(&folder.join("after.lattice").display().to_string());
    assert_eq!(shown(page), after);
    let inside = in_the_box(map);
    let left: Vec<&String> = all.iter().filter(|key| !inside.contains(key)).collect();
    assert_eq!(after.iter().collect::<Vec<_>>(), left);
    assert_eq!(inside.len() as u64, cleared);
}

#[test]
fn the_page_asks_first_and_the_mapper_loses_exactly_the_cells_of_the_box() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (map, params) = site(folder.path());
    let domain = LoopbackDomain::take().unwrap();
    let viewer = Viewer::start_in(&domain, &["view", &params, "--port", "0"]);
    let mut page = Page::open(&chromium, &viewer.url);
    let page = &mut page;
    clear_and_save(page, folder.path(), &map);
    // The mapper's word on a cell.
    page.value(
        "(() => { const { camera, cells } = lattice; camera.automatic = false; lattice.frame(); \
         for (let x = innerWidth * 0.4; x < innerWidth; x += 20) for (let y = 60; y < innerHeight; \
         y += 20) if (lattice.pick(x, y)) return; })()",
    );
    page.wait_for(
        "/mapper *occupied, [0-9]+ points/.test(document.getElementById('cell').textContent)",
    );
    // A parameter, then all of the map.
    page.value("document.getElementById('parameters').parentElement.open = true");
    let field = "document.getElementById('parameter /lattice_mapper.update_period_s')";
    page.wait_for(field);
    page.value(&format!(
        "{field}.dataset.old = 1; {field}.value = 0.25; {field}.dispatchEvent(new Event('change'))"
    ));
    // The server's answer is a field of its own.
    page.wait_for(&format!("!{field}.dataset.old && {field}.value === '0.25'"));
    page.value("document.getElementById('reset').click()");
    page.value("document.querySelector('#ask .do').click()");
    page.wait_for("lattice.state.size === 0");
    assert!(page.console.is_empty(), "{:?}", page.console);
}

#[test]
fn a_mapper_in_another_process_is_asked_over_dds() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (map, params) = site(folder.path());
    let domain = LoopbackDomain::take().unwrap();
    let arguments = [
        "node",
        "lattice_mapper",
        "--ros-args",
        "--params-file",
        &params,
    ];
    let mut mapper = record::start(&domain, &arguments);
    let arguments = ["-p", "viewer_server:allow_write:=true"];
    let viewer = ["view", "--port", "0", "--", "--ros-args"];
    let viewer = Viewer::start_in(&domain, &[&viewer[..], &arguments].concat());
    let mut page = Page::open(&chromium, &viewer.url);
    clear_and_save(&mut page, folder.path(), &map);
    let _ = mapper.kill();
    let _ = mapper.wait();
}

const BOBCAT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");

#[test]
fn a_log_that_plays_is_held_and_moved_from_the_page_of_a_phone() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let log = simulated(folder.path(), "mcap", "12");
    let reader = BagReader::open(log.as_ref()).unwrap();
    let (first_ns, last_ns) = (reader.start_ns().unwrap(), reader.end_ns().unwrap());
    let domain = LoopbackDomain::take().unwrap();
    let mut player = record::play(&domain, &log, &["start_paused:=true"]);
    let arguments = ["view", BOBCAT, "--port", "0", "--", "--ros-args"];
    let write = ["-p", "viewer_server:allow_write:=true"];
    let viewer = Viewer::start_in(&domain, &[&arguments[..], &write].concat());
    let mut page = Page::open(&chromium, "about:blank");
    let phone = json!({ "width": 390, "height": 800, "deviceScaleFactor": 2, "mobile": true });
    page.call("Emulation.setDeviceMetricsOverride", phone);
    page.go(&viewer.url);
    let pause = "document.getElementById('pause')";
    page.wait_for(&format!(
        "!document.getElementById('player').hidden && {pause}.textContent === 'Play'"
    ));
    page.value(
        "document.getElementById('sheet').hidden && document.getElementById('fold').click()",
    );
    let fits = "(() => { const panel = document.getElementById('panel'); \
        return !document.getElementById('sheet').hidden && panel.scrollWidth <= panel.clientWidth && innerWidth === 390; })()";
    assert_eq!(page.value(fits), true);
    page.value(&format!("{pause}.click()"));
    page.wait_for(&format!("{pause}.textContent === 'Pause'"));
    page.wait_for("lattice.state.size > 0 && lattice.player.now !== null");
    let rate = "document.getElementById('rate')";
    page.value(&format!(
        "{rate}.value = 0.5; {rate}.dispatchEvent(new Event('change')); {rate}.value = ''"
    ));
    page.wait_for(&format!("{rate}.value === '0.5'"));
    page.value(&format!("{pause}.click()"));
    page.wait_for(&format!("{pause}.textContent === 'Play'"));
    page.value("document.getElementById('step').click()");
    // The bar goes from the beginning of the log to its end, and to where a person drags it.
    let (first_s, last_s) = (first_ns as f64 * 1e-9, last_ns as f64 * 1e-9);
    let at = |page: &mut Page| page.value("lattice.player.log.now").as_f64().unwrap();
    // Times of the log come on a topic of their own, which may be discovered after the services.
    page.wait_for("lattice.player.log !== null");
    let ends = "[lattice.player.log.begin, lattice.player.log.end]";
    let ends: [f64; 2] = serde_json::from_value(page.value(ends)).unwrap();
    assert!((ends[0] - first_s).abs() < 1e-3 && (ends[1] - last_s).abs() < 1e-3);
    let seek = "document.getElementById('seek')";
    page.value(&format!(
        "{seek}.value = 750; {seek}.dispatchEvent(new Event('input')); {seek}.dispatchEvent(new Event('change'))"
    ));
    let sought_s = first_s + 0.75 * (last_s - first_s);
    // As the player states it, not as the page asked.
    page.value("lattice.player.log.now = 0");
    page.wait_for(&format!(
        "Math.abs(lattice.player.log.now - {sought_s}) < 0.01"
    ));
    let said = "document.getElementById('said').textContent";
    // Back by 10 s of 12, and not beyond the beginning.
    for _ in 0..2 {
        let before_s = at(&mut page);
        page.value("document.getElementById('back').click()");
        page.wait_for(&format!(
            "lattice.player.log.now < {before_s} - 0.1 || lattice.player.log.now - {first_s} < 0.01"
        ));
    }
    assert!(at(&mut page) - first_s < 0.01);
    assert_eq!(page.value(said), "");
    let time = "document.getElementById('log-time').textContent";
    page.wait_for(&format!("/^0:00 of 0:1[12]$/.test({time})"));
    page.value("document.getElementById('clear').click()");
    let fits = "(() => { const box = document.getElementById('ask').getBoundingClientRect(); \
        return box.left >= 0 && box.right <= 390 && document.activeElement.textContent === 'Cancel'; })()";
    assert_eq!(page.value(fits), true);
    assert!(page.console.is_empty(), "{:?}", page.console);
    let _ = player.kill();
    let _ = player.wait();
}
