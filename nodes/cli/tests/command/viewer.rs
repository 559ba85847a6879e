//! The page of the viewer server in a browser: its cells are those of the map.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use base64::prelude::*;
use lattice_core::voxels::file::MapContents;
use lattice_runtime::LoopbackDomain;
use serde_json::json;

use crate::browser::{chromium, devtools::Page};
use crate::record::signal;
use crate::text;

/// A process that serves a page.
pub struct Viewer {
    process: Child,
    pub url: String,
}

impl Viewer {
    fn show(map: &str, port: u16) -> Self {
        Self::start(&["view", map, "--port", &port.to_string()])
    }

    /// Starts a command that says where the page is.
    pub fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
        Self::run(command.args(arguments).env_remove("ROS_DOMAIN_ID"))
    }

    /// The same in a domain of its own.
    pub fn start_in(domain: &LoopbackDomain, arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
        command
            .args(arguments)
            .env("ROS_DOMAIN_ID", domain.id().to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST");
        Self::run(&mut command)
    }

    /// Runs a command that says where the page is.
    pub fn run(command: &mut Command) -> Self {
        let mut process = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (out, err) = (
            process.stdout.take().unwrap(),
            process.stderr.take().unwrap(),
        );
        let (tell, told) = std::sync::mpsc::channel();
        for stream in [
            Box::new(out) as Box<dyn std::io::Read + Send>,
            Box::new(err),
        ] {
            let tell = tell.clone();
            // To its end: a full pipe would stop the process.
            std::thread::spawn(move || {
                for line in BufReader::new(stream).lines().map_while(Result::ok) {
                    let word = line
                        .split([' ', ','])
                        .find(|word| word.starts_with("http://") || word.starts_with("https://"));
                    if let Some(url) = word {
                        let _ = tell.send(url.to_owned());
                    }
                }
            });
        }
        drop(tell);
        // It says so once it listens.
        let url = told.recv().unwrap();
        Self { process, url }
    }

    /// The server's process.
    pub fn process(&self) -> u32 {
        self.process.id()
    }

    /// Ends it in good order.
    pub fn end(mut self) {
        signal(&self.process, "-TERM");
        assert!(self.process.wait().unwrap().success());
    }

    fn port(&self) -> u16 {
        self.url.rsplit(':').next().unwrap().parse().unwrap()
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Points of a bumpy ground with a wall.
pub fn scene(folder: &Path, wall_m: f64) -> String {
    let mut points = String::new();
    for i in 0..120 {
        for k in 0..120 {
            let (x, y) = (f64::from(i) * 0.25 - 15.0, f64::from(k) * 0.25 - 15.0);
            points += &format!("{x} {y} {:.3}\n", (x / 4.0).sin() + (y / 5.0).cos());
            if k < 24 {
                points += &format!("{x} {wall_m} {:.3}\n", y + 15.0);
            }
        }
    }
    let path = folder.join(format!("{wall_m}.xyz"));
    std::fs::write(&path, points).unwrap();
    path.display().to_string()
}

pub fn map_of(cloud: &str, lattice: &str) -> String {
    let map = format!("{cloud}.{lattice}.lattice");
    text(&["quantize", cloud, "--lattice", lattice, "--map-out", &map]);
    map
}

/// Keys of a map file as the page names them, sorted.
pub fn keys(map: &str) -> Vec<String> {
    let file = std::fs::File::open(map).unwrap();
    let list = MapContents::read(BufReader::new(file), 1 << 20)
        .unwrap()
        .into_list(usize::MAX);
    let mut keys: Vec<String> = list
        .sorted()
        .iter()
        .map(|(key, _)| key.raw().to_string())
        .collect();
    keys.sort();
    assert!(keys.len() > 1000);
    keys
}

pub fn shown(page: &mut Page) -> Vec<String> {
    let keys = page.value("lattice.keys()");
    let mut keys: Vec<String> = serde_json::from_value(keys).unwrap();
    keys.sort();
    keys
}

/// Cells found at places of the screen, and those of them that are drawn elsewhere.
const PICK: &str = "(() => { const { camera, cells } = lattice; camera.automatic = false; lattice.frame(); \
    const [w, h] = [innerWidth, innerHeight]; let [hits, wrong] = [0, 0]; \
    for (let x = w * 0.3; x < w; x += 60) for (let y = 60; y < h; y += 60) { \
    if (!lattice.pick(x, y)) continue; hits++; const p = camera.project(lattice.state.chosen.centre); \
    if (Math.hypot(p.x - x, p.y - y) > 2 + 1.2 * cells.lattice.radius * camera.focal() / p.depth) wrong++; } \
    return [hits, wrong]; })()";

/// Key and count of each cell.
const CELLS: &str = "(async () => { const counts = await lattice.keys('counts'); \
    return (await lattice.keys()).map((key, i) => `${key} ${counts[i]}`).sort(); })()";

/// Distance of the robot from the middle of the view, pixels.
const OFF_MIDDLE: &str = "(() => { const { camera, state } = lattice; lattice.frame(); \
    const p = camera.project(state.robot.position); \
    return Math.hypot(p.x - (1 + camera.aside) / 2 * camera.width, p.y - camera.height / 2); })()";

pub const COMPLETE: &str = "lattice.state.open && lattice.state.complete";

#[test]
fn cells_of_each_lattice_are_drawn_as_the_map_has_them() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let cloud = scene(folder.path(), 5.0);
    let mut page = None;
    for lattice in ["cubic", "bcc", "fcc", "mcc", "hex"] {
        let map = map_of(&cloud, lattice);
        let viewer = Viewer::show(&map, 0);
        let page = page.get_or_insert_with(|| Page::open(&chromium, "about:blank"));
        page.go(&viewer.url);
        page.wait_for(COMPLETE);
        assert_eq!(shown(page), keys(&map), "{lattice}");
        let cells = page.value(CELLS);
        let lit = page.value("lattice.lit()").as_f64().unwrap();
        assert!(lit > 0.01, "{lattice}: {lit} of the pixels");
        let picked: [u64; 2] = serde_json::from_value(page.value(PICK)).unwrap();
        assert!(picked[0] > 10 && picked[1] == 0, "{lattice}: {picked:?}");
        assert_eq!(page.value("lattice.state.problems"), json!([]));
        let foreign: Vec<_> = page
            .requests
            .iter()
            .filter(|url| !is_own(url, &viewer.url))
            .collect();
        assert!(foreign.is_empty(), "{foreign:?}");
        assert!(page.console.is_empty(), "{:?}", page.console);
        page.go(&format!("{}/?thin=1", viewer.url));
        page.wait_for(COMPLETE);
        assert_eq!(page.value(CELLS), cells, "{lattice}, thin");
        assert_eq!(page.value("lattice.state.problems"), json!([]));
        page.requests.clear();
        // What the console says of the lost connection is not asked for.
        page.go("about:blank");
    }
}

fn is_own(url: &str, own: &str) -> bool {
    url.starts_with(own) || url.starts_with("data:") || url == "about:blank"
}

#[test]
fn a_page_whose_server_has_gone_says_so_and_has_the_new_map_when_it_is_back() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [before, after] = [4.0, 9.0].map(|wall_m| map_of(&scene(folder.path(), wall_m), "fcc"));
    let viewer = Viewer::show(&before, 0);
    let (url, port) = (viewer.url.clone(), viewer.port());
    let mut page = Page::open(&chromium, &url);
    page.wait_for(COMPLETE);
    assert_eq!(shown(&mut page), keys(&before));
    drop(viewer);
    page.wait_for("!document.getElementById('banner').hidden && lattice.cells.stale === 1");
    assert_eq!(shown(&mut page), keys(&before), "what was known stays");
    let _again = Viewer::show(&after, port);
    page.wait_for(&format!(
        "{COMPLETE} && document.getElementById('banner').hidden"
    ));
    let expected = keys(&after);
    page.wait_for(&format!("lattice.state.size === {}", expected.len()));
    assert_eq!(shown(&mut page), expected, "no cell of the map before");
    let mut second = Page::open(&chromium, &url);
    second.wait_for(COMPLETE);
    assert_eq!(shown(&mut second), expected);
}

#[test]
fn the_map_that_grows_in_a_demo_is_at_its_end_the_mappers() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let duration = match std::env::var_os("LATTICE_PICTURE") {
        Some(_) => "40",
        None => "12",
    };
    let demo = [
        "demo",
        "--lattice",
        "fcc",
        "--duration",
        duration,
        "--port",
        "0",
        "--out",
        &out,
    ];
    let mut viewer = Viewer::start(&demo);
    let mut thin = Page::open(&chromium, &format!("{}/?thin=1", viewer.url));
    let mut page = Page::open(&chromium, &viewer.url);
    page.wait_for("lattice.state.size > 100 && lattice.state.robot !== null");
    // Layers are of topics that somebody publishes: here is no headset.
    let layers = "[...document.querySelectorAll('#layers input[data-topic]')].map((box) => box.dataset.topic).sort().join()";
    page.wait_for(&format!("{layers} === '/fcc/map_centers,/points_enu'"));
    page.wait_for("/ of 0:/.test(document.getElementById('log-time').textContent) && document.getElementById('seek').disabled");
    page.value(
        "document.querySelectorAll('#layers input[data-topic]').forEach((box) => box.click())",
    );
    for topic in ["/points_enu", "/fcc/map_centers"] {
        page.wait_for(&format!(
            "lattice.state.clouds.get('{topic}').scans.length > 0"
        ));
    }
    page.value("document.querySelector('[data-camera=follow]').click()");
    // Each takes a frame, and the robot goes on.
    for _ in 0..40 {
        assert!(page.value(OFF_MIDDLE).as_f64().unwrap() < 5.0);
    }
    page.value("document.getElementById('fit').click()");
    page.value(
        "document.querySelectorAll('#layers input[data-topic]').forEach((box) => box.click())",
    );
    if let Some(path) = std::env::var_os("LATTICE_PICTURE") {
        // The picture in README, of a map that has grown for a while.
        page.wait_for("lattice.state.path.length > 120");
        page.value("Object.defineProperty(lattice.cells, 'pace', { get: () => 0, set() {} })");
        page.value("lattice.lit()");
        let picture = BASE64_STANDARD.decode(page.picture()).unwrap();
        std::fs::write(path, picture).unwrap();
    }
    assert!(viewer.process.wait().unwrap().success());
    page.wait_for("!document.getElementById('banner').hidden");
    let map = folder.path().join("map.lattice").display().to_string();
    assert_eq!(shown(&mut page), keys(&map));
    thin.wait_for("!document.getElementById('banner').hidden");
    assert_eq!(thin.value(CELLS), page.value(CELLS));
    for page in [&mut page, &mut thin] {
        assert_eq!(page.value("lattice.state.problems"), json!([]));
    }
}

/// A zstd frame of these bytes as they are (RFC 8878: a window of 128 kB, blocks of kind raw).
fn zstd_frame(bytes: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, 7 << 3];
    let mut blocks = bytes.chunks(128 << 10).peekable();
    while let Some(block) = blocks.next() {
        let head = u32::from(blocks.peek().is_none()) | (block.len() as u32) << 3;
        frame.extend(head.to_le_bytes().iter().take(3));
        frame.extend(block);
    }
    frame
}

#[test]
fn what_is_shown_is_told_by_its_name_and_what_is_not_shown_by_its_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    // A file of a log that is compressed.
    let log = crate::nodes::simulated(folder.path(), "mcap", "12");
    let files = std::fs::read_dir(&log)
        .unwrap()
        .map(|file| file.unwrap().path());
    let file = { files }.find(|file| file.extension().is_some_and(|ending| ending == "mcap"));
    let packed = zstd_frame(&std::fs::read(file.unwrap()).unwrap());
    std::fs::write(path("log.mcap.zstd"), packed).unwrap();
    let viewer = Viewer::start(&["view", &path("log.mcap.zstd"), "--port", "0"]);
    assert!(viewer.port() > 0);
    // Parameters, by either ending.
    let domain = LoopbackDomain::take().unwrap();
    let params = "/**/lattice_mapper:\n  ros__parameters: {cell_volume_m3: 0.125}\n";
    std::fs::write(path("nodes.yml"), params).unwrap();
    let viewer = Viewer::start_in(&domain, &["view", &path("nodes.yml"), "--port", "0"]);
    assert!(viewer.port() > 0);
    // Neither, nor what its name says.
    std::fs::write(path("part.step"), "ISO-10303-21;\n").unwrap();
    let refused = crate::error(&["view", &path("part.step")]);
    for word in ["part.step", ".lattice", ".las", ".mcap", ".zstd", ".yml"] {
        assert!(refused.contains(word), "{word} in {refused}");
    }
    std::fs::write(path("cloud.pcd"), "# .PCD v.7\n").unwrap();
    let refused = crate::error(&["view", &path("cloud.pcd")]);
    assert!(
        refused.contains("cloud.pcd: ") && refused.contains("header"),
        "{refused}"
    );
    let refused = crate::error(&["view", &path("nodes.yml"), &path("cloud.pcd")]);
    assert!(
        refused.contains("cloud.pcd") && refused.contains(".yml"),
        "{refused}"
    );
    let refused = crate::error(&["view", &path("nodes.yml"), "--cell-size", "0.2"]);
    assert!(
        refused.contains("--cell-size") && refused.contains("`cell_size_m`"),
        "{refused}"
    );
    let refused = crate::error(&["view", &format!("{log}/metadata.yaml")]);
    assert!(refused.contains("folder"), "{refused}");
}

#[test]
fn a_token_is_told_to_the_terminal_and_to_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
    let arguments = ["view", "--address", "0.0.0.0", "--port", "0"];
    command
        .args(arguments)
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env("ROS_LOG_DIR", folder.path());
    let viewer = Viewer::run(&mut command);
    let (_, token) = viewer.url.split_once("?token=").unwrap();
    assert_eq!(token.len(), 32);
    // Its log file is there by now: the line on the token comes before that on the address.
    let files = std::fs::read_dir(folder.path()).unwrap();
    let logs: Vec<String> = files
        .map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap())
        .collect();
    assert!(logs.concat().contains("a token"), "{logs:?}");
    assert!(!logs.concat().contains(token), "{logs:?}");
}
