//! Mixed reality in the page: a Quest 3 emulated in a captured room (npm `iwer` and `@iwer/sem`), and a robot whose map is
//! simulated from the mesh of that room or of another.

use std::path::{Path, PathBuf};

use base64::prelude::*;
use lattice_lab::evaluate::map_of_capture;
use lattice_runtime::LoopbackDomain;
use nalgebra::{Isometry3, Point3, Vector3};
use serde_json::{Value, json};

use crate::browser::chromium;
use crate::browser::devtools::Page;
use crate::viewer::Viewer;
use crate::viewer_foreign::folder;

/// Distance of drawn points from their true places that is allowed, m.
const OFF_M: f64 = 0.08;
/// Share of the pixels of each eye that the map of a room covers.
const COVERED: f64 = 0.5;

/// Pose of the captured room in the map.
fn map_from_capture() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(4.0, -7.0, 0.5), Vector3::z() * 0.7)
}

/// Emulates the headset in a room, with a view for each eye; `frames` has what each drew.
const DEVICE: &str = "const device = globalThis.device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true }); \
    device.installRuntime({ forceInstall: true }); device.installSEM(IWER_SEM.SyntheticEnvironmentModule); \
    device.sem.loadEnvironment(globalThis.room); device.position.set(0, 1.6, 0.3);";

/// Watches the frames of the page: opacity, pose and cells of each, and the covered share of the last one's eyes.
const WATCH: &str = "(() => { const { mixed, state } = lattice, gl = mixed.gl, frame = mixed.frame.bind(mixed); \
    globalThis.seen = { frames: [], covered: [], picked: [] }; globalThis.truth = null; \
    mixed.frame = (next) => { frame(next); if (!mixed.session) return; \
    const { opacity, drawn, pose, isOk } = mixed; seen.frames.push({ opacity, drawn, isOk, at: pose?.position.join() }); \
    const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight]; const pixels = new Uint8Array(4 * w * h); \
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels); const lit = [0, 0]; \
    for (let i = 0; i < w * h; i++) if (pixels[4 * i + 3] > 0) lit[i % w < w / 2 ? 0 : 1] += 2 / (w * h); \
    seen.covered = lit; if (truth) { truth(next); truth = null; } }; })()";

/// Distances of drawn points from their true places, m: of the vertices of the room, and of cells that are found at places
/// of the picture of each eye, by matrices of WebXR alone.
const OFF: &str = "new Promise((done) => { globalThis.truth = (frame) => { const { mixed, cells } = lattice; \
    const turn = ([x, y, z, w], v) => new DOMPoint(...v).matrixTransform(DOMMatrix.fromFloat64Array(new Float64Array([ \
      1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0, 2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0, \
      2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0, 0, 0, 0, 1]))); \
    const matrix = ({ position: [x, y, z], rotation }) => { const c = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => turn(rotation, axis)); \
      return DOMMatrix.fromFloat64Array(new Float64Array([...c.flatMap((p) => [p.x, p.y, p.z, 0]), x, y, z, 1])); }; \
    const of = (m) => DOMMatrix.fromFloat64Array(Float64Array.from(m)); \
    const [mesh] = [...frame.trueMeshes ?? frame.detectedMeshes].sort((a, b) => b.vertices.length - a.vertices.length); \
    const reference_from_mesh = of(frame.getPose(mesh.meshSpace, mixed.reference).transform.matrix); \
    const entity = room.spatialEntities.find((one) => one.triangleMesh_META).locatable_META; \
    const { position: p, orientation: o } = entity; \
    const capture_from_mesh = matrix({ position: [p.x, p.y, p.z], rotation: [o.x, o.y, o.z, o.w] }); \
    const ros = new DOMMatrix([0, -1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, 0, 0, 1]); \
    const true_map_from_mesh = matrix(PLACE).multiply(ros).multiply(capture_from_mesh); \
    const map_from_mesh = matrix(mixed.pose).multiply(reference_from_mesh); let vertices = 0; \
    for (let i = 0; i < mesh.vertices.length; i += 3) { const v = new DOMPoint(...mesh.vertices.subarray(i, i + 3)); \
      const [a, b] = [map_from_mesh, true_map_from_mesh].map((m) => v.matrixTransform(m)); vertices = Math.max(vertices, Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z)); } \
    const reference_from_map = reference_from_mesh.multiply(true_map_from_mesh.inverse()); const picked = []; \
    for (const view of frame.getViewerPose(mixed.reference).views) { const { x, y, width, height } = frame.session.renderState.baseLayer.getViewport(view); \
      const seen = mixed.seen(view, [x, y, width, height]); \
      for (let i = 1; i < 6; i++) for (let k = 1; k < 4; k++) { const [u, v] = [Math.round(i * width / 6), Math.round(k * height / 4)]; \
        const found = cells.pick(seen, u, v); if (!found) continue; \
        const place = [0, 1, 2].map((axis) => [0, 1, 2, 3, 4].reduce((sum, bit) => sum | ((found.place >> (3 * bit + axis)) & 1) << bit, 0)); \
        const centre = new DOMPoint(...cells.centre(found.tile, place)); \
        const q = centre.matrixTransform(of(view.projectionMatrix).multiply(of(view.transform.inverse.matrix)).multiply(reference_from_map)); \
        const pixels = Math.hypot((q.x / q.w + 1) / 2 * width - u, (q.y / q.w + 1) / 2 * height - v); \
        picked.push(pixels / seen.focal * q.w - cells.lattice.radius); } } \
    done({ vertices, picked }); }; })";

/// Recentres: the event, and an origin elsewhere, which the emulator does not move by itself.
const RECENTRE: &str = "(() => { const { mixed } = lattice; seen.frames = []; \
    const moved = new XRRigidTransform({ x: 0.6, y: 0, z: -0.4 }, { x: 0, y: 0.6, z: 0, w: 0.8 }); \
    mixed.reference = mixed.reference.getOffsetReferenceSpace(moved); device.recenter(); })()";

/// Leaves planes alone; the meshes stay for the truth.
const PLANES: &str = "(() => { const { get } = Object.getOwnPropertyDescriptor(XRFrame.prototype, 'detectedMeshes'); \
    Object.defineProperty(XRFrame.prototype, 'trueMeshes', { get }); \
    Object.defineProperty(XRFrame.prototype, 'detectedMeshes', { get() { } }); })()";

pub const BUTTON: &str = "document.getElementById('mixed')";

/// The emulator's scripts and a room, before any script of the page.
pub fn emulate(page: &mut Page, node: &Path, room: &Path) {
    let read = |path: &str| std::fs::read_to_string(node.join("node_modules").join(path)).unwrap();
    let room = std::fs::read_to_string(room).unwrap();
    for source in [
        read("iwer/build/iwer.min.js"),
        read("@iwer/sem/build/iwer-sem.min.js"),
        format!("globalThis.room = {room};"),
        DEVICE.to_owned(),
    ] {
        page.call(
            "Page.addScriptToEvaluateOnNewDocument",
            json!({ "source": source }),
        );
    }
}

pub fn capture(node: &Path, room: &str) -> PathBuf {
    let folder = node.join("node_modules/@iwer/sem/captures");
    folder.join(format!("{room}.json"))
}

/// Parameters of a robot that has mapped a captured room.
fn robot(folder: &Path, room: &Path) -> String {
    let cloud = map_of_capture(room, 1).unwrap();
    let point = |p: &Point3<f64>| {
        let p = map_from_capture() * p;
        format!("{:.4} {:.4} {:.4}\n", p.x, p.y, p.z)
    };
    let points: String = cloud.points_m.iter().map(point).collect();
    let path = |name: &str| folder.join(name).display().to_string();
    std::fs::write(path("room.xyz"), points).unwrap();
    let cells = ["--lattice", "fcc", "--cell-size", "0.05", "--map-out"];
    crate::text(
        &[
            &["quantize", &path("room.xyz")],
            &cells[..],
            &[&path("room.lattice")],
        ]
        .concat(),
    );
    let dir = folder.display();
    let params = format!(
        "/**/lattice_mapper:\n  ros__parameters: {{lattice: fcc, cell_size_m: 0.05, map_dir: '{dir}', \
         autosave_file: room.lattice, resume: true}}\n\
         /**/headset_cloud:\n  ros__parameters: {{labels_from: mesh}}\n\
         /**/semantic_icp_server:\n  ros__parameters: {{headset_axes: ros_flu}}\n\
         /**/viewer_server:\n  ros__parameters: {{allow_headset: true}}\n"
    );
    std::fs::write(path("nodes.yaml"), params).unwrap();
    path("nodes.yaml")
}

/// A page whose emulated headset is in one room, of a robot that has mapped a room.
fn open(chromium: &Path, node: &Path, params: &str, room: &str) -> (LoopbackDomain, Viewer, Page) {
    let domain = LoopbackDomain::take().unwrap();
    let viewer = Viewer::start_in(&domain, &["view", params, "--port", "0"]);
    let mut page = Page::open(chromium, "about:blank");
    emulate(&mut page, node, &capture(node, room));
    page.go(&viewer.url);
    page.wait_for(&format!(
        "lattice.state.complete && lattice.state.size > 1000 && !{BUTTON}.hidden && lattice.mixed.services.find('calibrate')"
    ));
    page.value(WATCH);
    (domain, viewer, page)
}

/// Presses the button and agrees.
fn agree(page: &mut Page) {
    page.value(&format!("{BUTTON}.click()"));
    page.value("document.querySelector('#ask .do').click()");
    page.wait_for("lattice.mixed.session !== null && seen.frames.length > 0");
}

/// Asserts that the map is drawn for both eyes where it truly is.
fn is_right(page: &mut Page) {
    page.wait_for("lattice.mixed.isOk && seen.frames.at(-1).opacity > 0.99");
    let place = map_from_capture();
    let rotation = place.rotation.coords.as_slice();
    let place = json!({"position": place.translation.vector.as_slice(), "rotation": rotation});
    let off = page.value(&OFF.replace("PLACE", &place.to_string()));
    let vertices = off["vertices"].as_f64().unwrap();
    assert!(vertices < OFF_M, "{off}");
    let picked = off["picked"].as_array().unwrap();
    assert!(picked.len() > 20, "{off}");
    assert!(
        picked.iter().all(|off| off.as_f64().unwrap() < OFF_M),
        "{off}"
    );
    for covered in page.value("seen.covered").as_array().unwrap() {
        assert!(covered.as_f64().unwrap() > COVERED, "{covered}");
    }
}

fn texts(page: &mut Page) -> Value {
    page.value("JSON.stringify(lattice.mixed.status(performance.now()))")
}

#[test]
fn the_map_stands_in_the_room_of_a_headset_and_is_found_again_after_recentring() {
    let Some(chromium) = chromium() else { return };
    let Some(node) = folder().map(PathBuf::from) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let params = robot(folder.path(), &capture(&node, "living_room"));
    let (_domain, _viewer, mut page) = open(&chromium, &node, &params, "living_room");
    // Without the user's agreement nothing begins.
    page.value(&format!("{BUTTON}.click()"));
    page.value("document.querySelector('#ask button').click()");
    assert_eq!(
        page.value("[lattice.mixed.session, lattice.mixed.sender]"),
        json!([null, null])
    );
    agree(&mut page);
    is_right(&mut page);
    if let Some(path) = std::env::var_os("LATTICE_MIXED_PICTURE") {
        let picture = BASE64_STANDARD.decode(page.picture()).unwrap();
        std::fs::write(path, picture).unwrap();
    }
    // Each frame before had nothing of the robot.
    let early = "seen.frames.slice(0, seen.frames.findIndex(({ isOk }) => isOk)).every(({ drawn }) => drawn === 0)";
    assert_eq!(page.value(early), json!(true));
    // With another origin the map that was drawn fades where it was, and is found again.
    page.value(RECENTRE);
    page.wait_for(
        "seen.frames.some(({ isOk }) => !isOk) && seen.frames.some(({ drawn }) => drawn === 0)",
    );
    is_right(&mut page);
    let moved = "(() => { let last = null; for (const { drawn, isOk, at } of seen.frames) { \
        if (last && !isOk && drawn > 0 && at !== last) return true; last = at; } return false; })()";
    assert_eq!(page.value(moved), json!(false));
    assert_eq!(page.value("lattice.state.problems"), json!([]));
    page.value(&format!("{BUTTON}.click()"));
    page.wait_for("lattice.mixed.session === null && lattice.lit() > 0.01");
    assert!(page.console.is_empty(), "{:?}", page.console);
}

#[test]
fn nothing_of_a_robot_is_drawn_in_a_room_that_it_has_not_mapped() {
    let Some(chromium) = chromium() else { return };
    let Some(node) = folder().map(PathBuf::from) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let params = robot(folder.path(), &capture(&node, "office_small"));
    let (_domain, _viewer, mut page) = open(&chromium, &node, &params, "living_room");
    agree(&mut page);
    page.wait_for("lattice.mixed.verdict > 1 && lattice.mixed.reason !== ''");
    let verdict = texts(&mut page);
    // And after a second request.
    page.wait_for("lattice.mixed.asking");
    page.wait_for("!lattice.mixed.asking");
    page.wait_for("seen.frames.length > 40");
    let drawn =
        page.value("seen.frames.filter(({ drawn, opacity }) => drawn > 0 || opacity > 0).length");
    assert_eq!(drawn, json!(0), "{verdict}");
    // Only the sign is there.
    for covered in page.value("seen.covered").as_array().unwrap() {
        let covered = covered.as_f64().unwrap();
        assert!(covered > 0.005 && covered < 0.1, "{covered}");
    }
}

#[test]
fn the_map_stands_in_the_other_captured_rooms() {
    let Some(chromium) = chromium() else { return };
    let Some(node) = folder().map(PathBuf::from) else {
        return;
    };
    for room in ["office_small", "meeting_room", "office_large", "music_room"] {
        let folder = tempfile::tempdir().unwrap();
        let params = robot(folder.path(), &capture(&node, room));
        let (_domain, _viewer, mut page) = open(&chromium, &node, &params, room);
        agree(&mut page);
        is_right(&mut page);
    }
}

#[test]
fn planes_alone_place_the_map_where_the_device_has_no_meshes() {
    let Some(chromium) = chromium() else { return };
    let Some(node) = folder().map(PathBuf::from) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let params = robot(folder.path(), &capture(&node, "living_room"));
    let (_domain, _viewer, mut page) = open(&chromium, &node, &params, "living_room");
    page.value(PLANES);
    agree(&mut page);
    is_right(&mut page);
    let few = page.value("lattice.mixed.sender.counts.triangles");
    assert!(few.as_u64().unwrap() < 500, "{few}");
}
