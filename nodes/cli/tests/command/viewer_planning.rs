//! A path between two picked cells: planned by the mapper, drawn by the page.

use std::io::BufReader;

use lattice_core::query::{Query, Segment};
use lattice_core::voxels::file::MapContents;
use lattice_runtime::LoopbackDomain;
use nalgebra::Vector3;

use crate::browser::{chromium, devtools::Page};
use crate::viewer::{COMPLETE, Viewer};
use crate::viewer_writing::site;

const RADIUS_M: f64 = 0.4;
/// Largest distance of an end from the centre of its cell: before its face, and beside that where it does not fit.
const END_M: f64 = 2.0 * RADIUS_M + 3.0 * 0.5 + 0.5;

/// Clicks on the first cell of the rows and columns that are named.
const PICK: &str = "(window.click = (columns) => { const { camera } = lattice; camera.automatic = false; lattice.frame(); \
    for (const column of columns) for (let y = 80; y < innerHeight - 80; y += 15) { \
    if (lattice.pick(innerWidth * column, y)) return true; } return false; })";

/// Share of the points of the path that have its colour in the picture.
const INKED: &str = "(() => { lattice.frame(); const { camera, cells: { gl }, planning } = lattice; \
    const inked = planning.path.filter((point) => { const { x, y } = camera.project(point); \
    const pixel = new Uint8Array(4); \
    gl.readPixels(Math.floor(x), camera.height - 1 - Math.floor(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); \
    return pixel[0] > 200 && pixel[1] < 160 && pixel[2] > 170; }); return inked.length / planning.path.length; })()";

const SAID: &str = "document.getElementById('way-said').textContent";

fn vectors(page: &mut Page, expression: &str) -> Vec<Vector3<f64>> {
    let points: Vec<[f64; 3]> = serde_json::from_value(page.value(expression)).unwrap();
    points.into_iter().map(Into::into).collect()
}

fn ask_with_radius(page: &mut Page, radius_m: f64) {
    let input = "document.getElementById('radius')";
    page.value(&format!(
        "{input}.value = {radius_m}; {input}.dispatchEvent(new Event('change'))"
    ));
}

#[test]
fn a_path_between_two_picks_begins_and_ends_there_and_touches_no_cell() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (map, params) = site(folder.path());
    let domain = LoopbackDomain::take().unwrap();
    let viewer = Viewer::start_in(&domain, &["view", &params, "--port", "0"]);
    let mut page = Page::open(&chromium, &viewer.url);
    page.wait_for(&format!("{COMPLETE} && lattice.state.size > 1000"));
    page.wait_for("!document.getElementById('way').hidden");
    ask_with_radius(&mut page, RADIUS_M);
    page.value("document.getElementById('plan').click()");
    page.value(PICK);
    for columns in ["[0.35, 0.4, 0.45, 0.5]", "[0.9, 0.85, 0.8, 0.7, 0.6]"] {
        assert_eq!(page.value(&format!("click({columns})")), true);
    }
    page.wait_for("lattice.planning.path.length > 1");
    let path = vectors(&mut page, "lattice.planning.path");
    let picks = vectors(
        &mut page,
        "lattice.planning.picks.map((pick) => pick.centre)",
    );
    assert!((picks[1] - picks[0]).norm() > 3.0, "{picks:?}");
    for (end, pick) in [(&path[0], &picks[0]), (&path[path.len() - 1], &picks[1])] {
        assert!((end - pick).norm() < END_M, "{end} of {pick}");
    }
    let file = std::fs::File::open(map).unwrap();
    let map = MapContents::read(BufReader::new(file), 1 << 20).unwrap();
    let list = map.into_list(usize::MAX);
    let query = Query::new(&list);
    for pair in path.windows(2) {
        let line = Segment {
            from_m: pair[0],
            to_m: pair[1],
        };
        assert!(query.is_free(&line, RADIUS_M - 1e-6).unwrap(), "{pair:?}");
    }
    assert_eq!(page.value(INKED), 1.0);
    let said = page.value(SAID);
    assert!(said.as_str().unwrap().ends_with(" m"), "{said}");
    // A ball that the mapper refuses, with its reason; then another that fits.
    ask_with_radius(&mut page, 9.5);
    page.wait_for(&format!("/radius of 9.5 m/.test({SAID})"));
    assert_eq!(page.value("lattice.planning.path.length"), 0);
    ask_with_radius(&mut page, 0.0);
    page.wait_for("lattice.planning.path.length > 1");
    assert!(page.console.is_empty(), "{:?}", page.console);
}
