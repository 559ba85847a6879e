//! What a person changes through the page: off unless it is allowed, and asked for first.

use std::io::BufReader;
use std::path::Path;

use async_tungstenite::tungstenite::client::IntoClientRequest;
use async_tungstenite::tungstenite::{Message, connect};
use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::MapContents;
use serde_json::{Value, json};

use crate::browser::{chromium, devtools::Page};
use crate::viewer::{COMPLETE, Viewer, keys, map_of, scene, shown};

/// Between two layers of centres.
const BOX_END_M: f64 = 0.1;

/// Parameters of a mapper that goes on from a map, and of a viewer.
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

/// Capabilities and services that the server tells of.
fn offered(url: &str) -> (Value, Vec<String>) {
    let mut request = url.replace("http", "ws").into_client_request().unwrap();
    let protocol = "foxglove.websocket.v1".parse().unwrap();
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let (mut socket, _) = connect(request).unwrap();
    let mut capabilities = Value::Null;
    loop {
        let Message::Text(text) = socket.read().unwrap() else {
            continue;
        };
        let message: Value = serde_json::from_str(&text).unwrap();
        match message["op"].as_str().unwrap() {
            "serverInfo" => capabilities = message["capabilities"].clone(),
            "advertiseServices" => {
                let services = message["services"].as_array().unwrap().iter();
                let names = services.map(|service| service["name"].as_str().unwrap().to_owned());
                return (capabilities, names.collect());
            }
            _ => {}
        }
    }
}

#[test]
fn without_leave_nothing_is_offered_that_changes_something() {
    let folder = tempfile::tempdir().unwrap();
    let map = map_of(&scene(folder.path(), 5.0), "fcc");
    let params = params(folder.path(), &map, false);
    let viewer = Viewer::start(&["view", &params, "--port", "0"]);
    let (capabilities, services) = offered(&viewer.url);
    assert_eq!(capabilities, json!(["services"]));
    let reading = [
        "lattice_mapper/query",
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
    // No is no.
    page.value("document.querySelector('#ask [type=button]').click()");
    page.wait_for("!document.getElementById('ask').open");
    page.value("document.getElementById('clear').click()");
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

#[test]
fn the_page_asks_first_and_the_mapper_loses_exactly_the_cells_of_the_box() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let map = map_of(&scene(folder.path(), 5.0), "fcc");
    let all = keys(&map);
    let params = params(folder.path(), &map, true);
    let viewer = Viewer::start(&["view", &params, "--port", "0"]);
    let mut page = Page::open(&chromium, &viewer.url);
    let (before, cleared) = clear_a_box(&mut page);
    assert_eq!((before, cleared > 100), (all.len() as u64, true));
    // What the mapper has is what the page shows: saved, and read here.
    page.value("document.getElementById('save').click()");
    page.value("document.getElementById('save-name').value = 'after.lattice'");
    page.value("document.querySelector('#ask .do').click()");
    page.wait_for("/saved/.test(document.getElementById('said').textContent)");
    let after = keys(&folder.path().join("after.lattice").display().to_string());
    assert_eq!(shown(&mut page), after);
    let gone: Vec<&String> = all.iter().filter(|key| !after.contains(key)).collect();
    assert_eq!(gone.len() as u64, cleared);
    assert!(after.iter().all(|key| all.binary_search(key).is_ok()));
    let inside = in_the_box(&map);
    assert_eq!(gone, inside.iter().collect::<Vec<_>>());
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
