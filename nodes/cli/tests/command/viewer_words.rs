//! What the page says of the map: file or live, why it is empty, where is north, how long is a metre.

use std::fs::File;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_core::voxels::label_names::{LabelNames, write_named};
use lattice_core::voxels::{Payload, VoxelList};
use nalgebra::Vector3;
use serde_json::json;

use crate::browser::chromium;
use crate::browser::devtools::Page;
use crate::browser::stage::{Known, Stage};
use crate::viewer::{COMPLETE, Viewer};

const STATE: &str = "document.getElementById('state').textContent";

fn text_of(id: &str) -> String {
    format!("document.getElementById('{id}').textContent")
}

/// Cells one above the other, 0 to 11 m.
fn tower() -> Vec<Known> {
    (0..12)
        .map(|i| Known::new([0, 0, 2 * i], 1, 65_535))
        .collect()
}

/// A map file of a row of cells: two thirds with a label, of which one has a name.
fn labelled_file(path: &std::path::Path) {
    let lattice = Lattice::new(LatticeKind::Fcc, 0.008).unwrap();
    let list = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
    let mut list = list.with_payload(Payload {
        labels: true,
        ..Payload::default()
    });
    let points: Vec<_> = (0..30)
        .map(|i| Vector3::new(f64::from(i), 0.0, 0.5))
        .collect();
    let labels: Vec<u16> = (0..20).map(|i| 4 + i % 2).collect();
    list.insert_labelled(&Cloud::from_points(5, Vector3::zeros(), &points), &labels);
    let names = LabelNames::from([(4, "wall <i>".to_owned()), (9, "nobody".to_owned())]);
    let map = MapContents::from_list(&list);
    write_named(
        &map,
        &names,
        File::create(path).unwrap(),
        &WriteOptions::default(),
    )
    .unwrap();
}

#[test]
fn a_file_is_called_so_and_has_the_names_of_its_labels() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    labelled_file(&path("site.lattice"));
    // A part of it keeps the names.
    let [site, part] =
        ["site.lattice", "part.lattice"].map(|name| path(name).display().to_string());
    let low = ["map", "crop", &site, "--min", "-1", "-1", "-1"];
    crate::text(&[&low[..], &["--max", "19.5", "1", "1", "--out", &part]].concat());
    for (map, expected) in [
        (&site, "label 5|10|no label|10|wall <i>|10"),
        (&part, "label 5|10|wall <i>|10"),
    ] {
        let viewer = Viewer::start(&["view", map, "--port", "0"]);
        let mut page = Page::open(&chromium, &viewer.url);
        page.wait_for(&format!("{COMPLETE} && {STATE} === 'file'"));
        assert_eq!(page.value(&text_of("lattice")), "FCC, cells of 0.2 m");
        page.value("(() => { const colour = document.getElementById('colour'); colour.value = 'label'; colour.dispatchEvent(new Event('change')); })()");
        let rows = "(() => { const parts = [...document.querySelectorAll('#legend .names span')].map((part) => part.textContent); \
            return parts.map((_, i) => i % 2 ? '' : parts.slice(i, i + 2).join('|')).filter(Boolean).sort().join('|'); })()";
        page.wait_for(&format!("{rows} === '{expected}'"));
        // Of what changes and of nodes a file knows nothing.
        let hidden = "['changed', 'rates', 'nodes', 'player', 'headset', 'way', 'write'].filter((id) => document.getElementById(id).checkVisibility())";
        assert_eq!(page.value(hidden), json!([]));
        let layers =
            "[...document.querySelectorAll('#layers label')].map((box) => box.textContent)";
        assert_eq!(page.value(layers), json!(["Cells", "Ground grid"]));
        assert!(page.console.is_empty(), "{:?}", page.console);
    }
}

#[test]
fn an_empty_map_shows_the_causes_that_nodes_state() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::live(&[]);
    let mut page = Page::open(&chromium, &stage.url);
    page.wait_for(&format!("/no cells/.test({})", text_of("nothing")));
    let why = "no transform base_link <- os_lidar; the log has body <- os_lidar";
    stage.state("robot/enu_transformer: clouds", 1, why, &[]);
    stage.state("robot/lattice_mapper: map", 2, "no cloud yet", &[]);
    stage.state("viewer_server: viewer", 1, "a client less", &[]);
    stage.state("robot/enu_transformer: poses", 0, "all is well", &[]);
    let expected = json!([
        format!("robot/enu_transformer: {why}"),
        "robot/lattice_mapper: no cloud yet"
    ]);
    // Together: what was stated is old after 5 s.
    let lines = "JSON.stringify([...document.querySelectorAll('#nothing li')].map((line) => line.textContent))";
    page.wait_for(&format!("{STATE} === 'empty' && {lines} === '{expected}'"));
    stage.replace(&tower());
    page.wait_for(&format!(
        "document.getElementById('nothing').hidden && {STATE} === 'live'"
    ));
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}

#[test]
fn a_banner_is_there_only_after_a_connection_was_lost() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&tower());
    let mut page = Page::open(&chromium, "about:blank");
    // For the first 4 s: a slow machine may take longer to connect.
    let watch = "document.addEventListener('DOMContentLoaded', () => { window.shown = []; const look = () => { \
        if (performance.now() > 4000) return; \
        if (!document.getElementById('banner').hidden) window.shown.push('banner'); \
        if (document.getElementById('light').classList.contains('bad')) window.shown.push('red'); }; \
        new MutationObserver(look).observe(document.body, { subtree: true, childList: true, attributes: true }); look(); })";
    page.call(
        "Page.addScriptToEvaluateOnNewDocument",
        json!({ "source": watch }),
    );
    page.go(&stage.url);
    page.wait_for(&format!("{COMPLETE} && {STATE} === 'live'"));
    assert_eq!(page.value("window.shown"), json!([]));
    drop(stage);
    page.wait_for(&format!(
        "!document.getElementById('banner').hidden && {STATE} === 'not connected'"
    ));
}

#[test]
fn the_axes_point_as_the_map_lies_and_the_bar_is_as_long_as_it_says() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&tower());
    let mut page = Page::open(&chromium, &stage.url);
    page.wait_for(COMPLETE);
    let axes = |page: &mut Page| {
        let axes = page.value(
            "(lattice.frame(), lattice.drawing.compass.axes.map(([name, x, y]) => [name, Math.round(x * 100) / 100 + 0, Math.round(y * 100) / 100 + 0]).sort())",
        );
        axes.to_string()
    };
    page.value("document.querySelector('[data-camera=top]').click()");
    assert_eq!(axes(&mut page), r#"[["E",1,0],["N",0,-1],["up",0,0]]"#);
    page.value("document.querySelector('[data-camera=side]').click()");
    assert_eq!(axes(&mut page), r#"[["E",1,0],["N",0,-0.02],["up",0,-1]]"#);
    // Each bar is as long as its length at the middle of the view.
    page.value("document.querySelector('[data-camera=top]').click()");
    for distance in ["7", "60", "333", "4000"] {
        let off = page.value(&format!(
            "(() => {{ const {{ camera, drawing }} = lattice; camera.automatic = false; camera.distance = {distance}; lattice.frame(); \
             const {{ length, pixels }} = drawing.compass; const [x, y, z] = camera.target; \
             const ends = [camera.project([x, y, z]), camera.project([x + length, y, z])]; \
             const {{ ratio }} = drawing.view(); return [Math.abs((ends[1].x - ends[0].x) / ratio - pixels), pixels, length]; }})()"
        ));
        let [off, pixels, length]: [f64; 3] = serde_json::from_value(off).unwrap();
        assert!(off < 0.01 && (40.0..=120.0).contains(&pixels), "{length} m");
        let digits = length / 10_f64.powf(length.log10().floor());
        assert!([1.0, 2.0, 5.0].iter().any(|d| (digits - d).abs() < 1e-9));
    }
}

#[test]
fn a_saved_picture_has_the_legend_the_axes_and_the_bar() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&tower());
    let mut page = Page::open(&chromium, &stage.url);
    page.wait_for(&format!("{COMPLETE} && lattice.cells.stale === 0"));
    // Colours of the palette along the bar of the legend, and those of axes in the lower right corner.
    let look = "(async () => { const { paletteBytes } = await import('/colours.js'); const { cssColour } = await import('/drawing.js'); \
        const canvas = lattice.picture(); const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data; \
        const near = (x, y, colour) => [0, 1, 2].every((k) => Math.abs(pixels[4 * (y * canvas.width + x) + k] - colour[k]) < 12); \
        const palette = paletteBytes('height'); \
        const row = [...Array(220).keys()].filter((y) => [16, 128, 240].every((i) => { \
          const colour = palette.subarray(4 * i, 4 * i + 3); \
          for (let x = 0; x < 260; x++) if (near(x, y, colour)) return true; return false; })); \
        const axes = ['--east', '--north', '--up'].map((name) => { const hex = cssColour(name); \
          const colour = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)); let found = 0; \
          for (let y = canvas.height - 180; y < canvas.height; y++) for (let x = canvas.width - 180; x < canvas.width; x++) if (near(x, y, colour)) found++; \
          return found > 20; }); \
        return [row.length > 5, axes, [canvas.width, canvas.height]]; })()";
    let seen = page.value(look);
    let size = page
        .value("[document.getElementById('view').width, document.getElementById('view').height]");
    assert_eq!(seen, json!([true, [true, true, true], size]));
}

#[test]
fn heights_span_what_is_there_and_a_click_beside_a_cell_says_so() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&tower());
    let mut page = Page::open(&chromium, &stage.url);
    page.wait_for(COMPLETE);
    let ends = |page: &mut Page| {
        let [low, high] = ["low-value", "high-value"].map(|id| page.value(&text_of(id)));
        (
            low.as_str().unwrap().to_owned(),
            high.as_str().unwrap().to_owned(),
        )
    };
    let pair = |low: &str, high: &str| (low.to_owned(), high.to_owned());
    page.wait_for(&format!("{} === '11.00 m'", text_of("high-value")));
    assert_eq!(ends(&mut page), pair("0.00 m", "11.00 m"));
    // Without a robot the roof is the upper part of the heights, with one what is above it.
    page.value("document.getElementById('roof').click()");
    let cut_m = page.value("lattice.cells.slice[1]").as_f64().unwrap();
    assert!((4.0..9.0).contains(&cut_m), "{cut_m}");
    stage.robot_at([0.0, 0.0, 1.0]);
    page.wait_for("Math.abs(lattice.cells.slice[1] - 2.6) < 1e-6");
    assert_eq!(ends(&mut page), pair("0.00 m", "2.60 m"));
    // A higher map: the slider moves, the cut stays.
    let mut higher = tower();
    higher.push(Known::new([0, 0, 60], 1, 65_535));
    stage.replace(&higher);
    page.wait_for("lattice.slice.span[1] === 30");
    assert_eq!(ends(&mut page), pair("0.00 m", "2.60 m"));
    page.value("document.getElementById('roof').click()");
    assert_eq!(ends(&mut page), pair("0.00 m", "30.00 m"));
    let beside = "(() => { lattice.frame(); const note = document.getElementById('note'); \
        return [lattice.pick(1270, 10), note.hidden, note.textContent, document.getElementById('chosen').hidden]; })()";
    assert_eq!(
        page.value(beside),
        json!([null, false, "no cell here", true])
    );
    page.wait_for("document.getElementById('note').hidden");
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}
