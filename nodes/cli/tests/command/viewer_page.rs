//! The page's layers and controls on a map of few cells that are known: colours, slice, verdicts, phone.

use lattice_msgs::geometry_msgs::Vector3;
use lattice_msgs::lattice::{CalibrationResult, WeakDirection};
use serde_json::json;

use crate::browser::chromium;
use crate::browser::devtools::Page;
use crate::browser::stage::{Known, Stage};

/// Cells 2 m apart, each 1 m above the one before.
fn stairs() -> Vec<Known> {
    let label = |i: usize| [3, 7, 65_535][i % 3];
    (0..12)
        .map(|i| {
            Known::new(
                [4 * i as i32, 0, 2 * i as i32],
                (1 << i) - 1 + u32::from(i == 0),
                label(i),
            )
        })
        .collect()
}

/// Functions with which tests look at the picture.
const LOOK: &str = r#"(async () => {
  const { placeIndex } = await import("/keys.js");
  const { paletteBytes, labelColour } = await import("/colours.js");
  const { camera, cells, frame, pick } = lattice;
  const gl = cells.gl;
  const at = (point) => {
    const { x, y } = camera.project(point);
    const pixel = new Uint8Array(4);
    gl.readPixels(Math.floor(x), camera.height - 1 - Math.floor(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return [...pixel.subarray(0, 3)];
  };
  const centre = ({ key }) => cells.centre(Number(BigInt(key) >> 15n), placeIndex(Number(BigInt(key) & 32767n)));
  // A face that looks up is lit like this.
  const LIGHT = 0.52 + 0.3 + (0.22 * 0.2) / Math.hypot(0.55, 0.75, 0.2);
  // With true shapes, however slow the machine is.
  const picture = () => {
    cells.pace = 0;
    frame();
  };
  window.look = {
    at, centre,
    click(cell) {
      const { x, y } = camera.project(centre(cell));
      pick(x, y);
    },
    // Largest difference of a colour from that of the legend, of cells seen from above.
    offLegend(known, value) {
      picture();
      const [low, high] = cells.colour.range;
      const palette = paletteBytes(lattice.state.mode);
      const off = known.map((cell) => {
        const t = Math.min(1, Math.max(0, (value(cell) - low) / (high - low)));
        const i = 4 * Math.min(255, Math.floor(t * 256));
        const shade = lattice.state.mode !== "label" ? [...palette.subarray(i, i + 3)]
          : cell.label === 65535 ? [115, 115, 115] : labelColour(cell.label).match(/\d+/g).map(Number);
        const seen = at(centre(cell));
        return Math.max(...shade.map((x, k) => Math.abs(x * LIGHT - seen[k])));
      });
      return Math.max(...off);
    },
    // Cells in the slice, cells drawn, and cells that a click finds.
    sliced(known) {
      const set = (id, value) => {
        const input = document.getElementById(id);
        input.value = value;
        input.dispatchEvent(new Event("input"));
      };
      return [[0, 1000], [300, 1000], [0, 600], [350, 650]].map(([low, high]) => {
        set("low", low);
        set("high", high);
        cells.chosen = null;
        picture();
        const [least, most] = cells.slice;
        const ground = getComputedStyle(document.documentElement).getPropertyValue("--ground").trim();
        const isGround = (pixel) => pixel.every((x, k) => Math.abs(x - parseInt(ground.slice(1 + 2 * k, 3 + 2 * k), 16)) < 30);
        const keys = (is) => known.filter(is).map(({ key }) => key);
        const within = keys((cell) => centre(cell)[2] >= least && centre(cell)[2] <= most);
        const drawn = keys((cell) => !isGround(at(centre(cell))));
        const clicked = keys((cell) => {
          const { x, y } = camera.project(centre(cell));
          const found = pick(x, y);
          return found && (BigInt(found.tile) * 32768n + BigInt(found.place)).toString() === cell.key;
        });
        return [within, drawn, clicked];
      });
    },
  };
})()"#;

/// All is there, and no longer grey as before the first word of the server.
const COMPLETE: &str = "lattice.state.open && lattice.state.complete && lattice.cells.stale === 0";

fn open(chromium: &std::path::Path, stage: &Stage) -> Page {
    let mut page = Page::open(chromium, &stage.url);
    page.wait_for(COMPLETE);
    page.value(LOOK);
    page
}

#[test]
fn colours_and_slice_are_those_of_the_legend_and_the_range() {
    let Some(chromium) = chromium() else { return };
    let known = stairs();
    let stage = Stage::show(&known);
    let mut page = open(&chromium, &stage);
    let known = serde_json::to_string(&known).unwrap();
    page.value("document.querySelector('[data-camera=top]').click()");
    for (mode, value) in [
        ("height", "(cell) => look.centre(cell)[2]"),
        ("count", "(cell) => Math.log2(cell.count + 1)"),
        ("label", "() => 0"),
    ] {
        page.value(&format!("document.getElementById('colour').value = '{mode}'; document.getElementById('colour').dispatchEvent(new Event('change'))"));
        let off = page.value(&format!("look.offLegend({known}, {value})"));
        assert!(off.as_f64().unwrap() < 8.0, "{mode}: {off}");
    }
    page.value("document.getElementById('colour').value = 'age'; document.getElementById('colour').dispatchEvent(new Event('change'))");
    let begun = page.value("lattice.cells.now").as_f64().unwrap();
    // They grow older though nothing comes.
    page.wait_for(&format!("lattice.cells.now > {begun} + 0.5"));
    for age_s in [0, 30, 90] {
        let seen = "lattice.state.now";
        let off = page.value(&format!(
            "lattice.cells.now = {seen} + {age_s}, look.offLegend({known}, () => {age_s})"
        ));
        assert!(off.as_f64().unwrap() < 8.0, "age {age_s} s: {off}");
    }
    page.value("document.getElementById('colour').value = 'height'; document.getElementById('colour').dispatchEvent(new Event('change'))");
    page.value("document.querySelector('[data-camera=side]').click()");
    let sliced = page.value(&format!("look.sliced({known})"));
    let sliced: Vec<[Vec<String>; 3]> = serde_json::from_value(sliced).unwrap();
    for (i, [within, drawn, clicked]) in sliced.iter().enumerate() {
        assert_eq!(within, drawn, "slice {i}");
        assert_eq!(within, clicked, "slice {i}");
    }
    let sizes: Vec<usize> = sliced.iter().map(|[within, ..]| within.len()).collect();
    assert_eq!(sizes[0], 12);
    assert!(
        sizes[1..].iter().all(|size| (2..11).contains(size)),
        "{sizes:?}"
    );
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}

#[test]
fn a_click_gives_key_and_count_of_a_cell_and_two_their_distance() {
    let Some(chromium) = chromium() else { return };
    let known = stairs();
    let stage = Stage::show(&known);
    let mut page = open(&chromium, &stage);
    page.value("document.querySelector('[data-camera=top]').click(); lattice.frame()");
    let click = |page: &mut Page, cell: &Known| {
        page.value(&format!("look.click({})", json!(cell)));
    };
    for cell in &known {
        click(&mut page, cell);
        let Known { key, count, .. } = cell;
        page.wait_for(&format!(
            "String(lattice.state.cell?.key) === '{key}' && Number(lattice.state.cell.count) === {count}"
        ));
    }
    page.value("document.getElementById('measure').click()");
    click(&mut page, &known[0]);
    click(&mut page, &known[11]);
    let ends = page.value("lattice.state.measured");
    let ends: [[f64; 3]; 2] = serde_json::from_value(ends).unwrap();
    let steps: f64 = (0..3).map(|k| (ends[1][k] - ends[0][k]).powi(2)).sum();
    // 44 and 22 cells of 0.5 m.
    let expected_m = 0.5 * 44_f64.hypot(22.0);
    assert!((steps.sqrt() - expected_m).abs() < 1e-3, "{ends:?}");
}

#[test]
fn labels_have_the_names_that_label_info_tells() {
    let Some(chromium) = chromium() else { return };
    let known = stairs();
    let stage = Stage::show(&known);
    let mut page = open(&chromium, &stage);
    page.value("document.getElementById('colour').value = 'label'; document.getElementById('colour').dispatchEvent(new Event('change'))");
    // Each with its cells, and those that have none.
    let legend = |rows: &str| {
        format!(
            "[...document.querySelectorAll('#legend .names span')].map((part) => part.textContent).join('|') === '{rows}'"
        )
    };
    page.wait_for(&legend("label 3|4|label 7|4|no label|4"));
    stage.names(&[(3, "robot <b>1</b>"), (9, "nobody")]);
    page.wait_for(&legend("robot <b>1</b>|4|label 7|4|no label|4"));
    page.value("document.querySelector('[data-camera=top]').click()");
    let first = serde_json::to_string(&known[0]).unwrap();
    let click = format!(
        "(() => {{ const {{ x, y }} = lattice.camera.project(look.centre({first})); lattice.pick(x, y); }})()"
    );
    page.value(&click);
    page.wait_for("document.getElementById('cell').textContent.includes('robot <b>1</b>')");
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}

#[test]
fn each_verdict_has_its_text_and_class_and_its_open_directions_are_drawn() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&stairs());
    let mut page = open(&chromium, &stage);
    let headset = "[...document.querySelectorAll('#layers label')].some((box) => box.textContent === 'Headset')";
    assert_eq!(page.value(headset), false, "there is none yet");
    for (verdict, name, class) in [
        (CalibrationResult::NONE, "nothing found yet", ""),
        (CalibrationResult::AMBIGUOUS, "AMBIGUOUS", "bad"),
        (CalibrationResult::OK, "OK", "ok"),
        (CalibrationResult::DEGENERATE, "DEGENERATE", "bad"),
        (CalibrationResult::NO_OVERLAP, "NO OVERLAP", "bad"),
        (CalibrationResult::REJECTED_INPUT, "REJECTED INPUT", "bad"),
    ] {
        let mut result = CalibrationResult {
            verdict,
            reason: format!("reason {verdict}"),
            ..CalibrationResult::default()
        };
        result.transform.rotation.w = 1.0;
        result.transform.translation = Vector3 {
            x: 6.0,
            y: -4.0,
            z: 8.0,
        };
        if verdict == CalibrationResult::DEGENERATE {
            let weak = |kind, sigma, x, y| WeakDirection {
                axis: Vector3 { x, y, z: 0.0 },
                kind,
                sigma,
            };
            result.weak_directions = vec![
                weak(WeakDirection::TRANSLATION, 3.0, 1.0, 0.0),
                weak(WeakDirection::ROTATION, 0.5, 0.0, 1.0),
            ];
        }
        stage.calibrated(&result);
        page.wait_for(&format!(
            "document.getElementById('verdict').textContent === '{name}: reason {verdict}'"
        ));
        assert_eq!(
            page.value("document.getElementById('verdict').className"),
            class,
            "{name}"
        );
        assert_eq!(page.value(headset), true);
        let drawn = page.value("lattice.state.headset !== null");
        assert_eq!(drawn, verdict != CalibrationResult::NONE, "{name}");
        if verdict == CalibrationResult::DEGENERATE {
            let words = page
                .value("[...document.querySelectorAll('#weak p')].map((line) => line.textContent)");
            assert_eq!(
                words,
                json!([
                    "open along 1.00, 0.00, 0.00: ± 3.00 m",
                    "open about 0.00, 1.00, 0.00: ± 28.6°"
                ])
            );
            // The ink of open directions, within a pixel of the line.
            let inked = "(() => { document.querySelector('[data-camera=top]').click(); lattice.frame(); \
                return [-2.5, -1, 1, 2.5].map((x) => [-1, 0, 1].some((dy) => { \
                const step = lattice.camera.distance / lattice.camera.focal(); \
                const [r, g, b] = look.at([6 + x, -4 + dy * step, 8]); return r > 180 && b > 180 && g < 190; })); })()";
            assert_eq!(page.value(inked), json!([true, true, true, true]));
        } else {
            assert_eq!(page.value("document.querySelectorAll('#weak p').length"), 0);
        }
    }
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}

#[test]
fn free_space_is_drawn_while_it_is_wanted() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&stairs());
    let free: Vec<Known> = (0..5)
        .map(|i| Known::new([4 * i, 8, 0], 1, 65_535))
        .collect();
    stage.frees(&free);
    let mut page = open(&chromium, &stage);
    let free = serde_json::to_string(&free).unwrap();
    page.value("document.querySelector('[data-camera=top]').click()");
    page.value("document.getElementById('colour').value = 'height'");
    // Green beside its ground, within two pixels of each centre.
    let greens = format!(
        "(() => {{ lattice.frame(); return {free}.filter(({{ index }}) => [-1, 0, 1].some((dx) => [-1, 0, 1].some((dy) => {{ \
         const step = lattice.camera.distance / lattice.camera.focal(); \
         const [r, g] = look.at([index[0] / 2 + dx * step, index[1] / 2 + dy * step, 0]); return g > r + 25; }}))).length; }})()"
    );
    let click = "document.querySelector('#layers input[data-topic=\"/free\"]').click()";
    assert_eq!(page.value(&greens), 0);
    page.value(click);
    page.wait_for("lattice.free.size === 5 && lattice.free.tiles.size > 0");
    assert_eq!(page.value(&greens), 5);
    page.value(click);
    assert_eq!(page.value(&greens), 0);
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}

#[test]
fn the_corrected_path_and_its_loops_are_drawn_in_the_frame_of_the_map() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&stairs());
    stage.robot_at([1.0, 6.0, 0.0]);
    let path = [0.0, 2.0, 4.0].map(|x| [x, 5.0, 0.0]);
    stage.drive("map", &path, &[[0.0, 8.0, 0.0], [10.0, 8.0, 0.0]]);
    let mut page = open(&chromium, &stage);
    page.wait_for("lattice.state.robot && lattice.state.drive.length === 3 && lattice.state.loops.length === 2");
    page.value("document.querySelector('[data-camera=top]').click()");
    // Within two pixels of the middle of the line.
    let is_green = "(() => { lattice.frame(); return [-2, -1, 0, 1, 2].some((dy) => { \
        const step = lattice.camera.distance / lattice.camera.focal(); \
        const [r, g] = look.at([5, 8 + dy * step, 0]); return g > r + 40; }); })()";
    assert_eq!(page.value(is_green), true);
    stage.drive("odom", &path, &[]);
    page.wait_for("lattice.state.drive.length === 0 && lattice.state.loops.length === 0");
    assert_eq!(page.value(is_green), false);
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}

#[test]
fn on_a_phone_a_pinch_halves_the_distance_and_panels_fit() {
    let Some(chromium) = chromium() else { return };
    let stage = Stage::show(&stairs());
    let mut page = Page::open(&chromium, "about:blank");
    let phone = json!({ "width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": true });
    page.call("Emulation.setDeviceMetricsOverride", phone);
    let touch = json!({ "enabled": true, "maxTouchPoints": 2 });
    page.call("Emulation.setTouchEmulationEnabled", touch);
    page.go(&stage.url);
    page.wait_for(COMPLETE);
    let before = page
        .value("lattice.frame(), lattice.camera.distance")
        .as_f64()
        .unwrap();
    let fingers = |apart: f64| json!([{ "x": 195.0 - apart / 2.0, "y": 300, "id": 1 }, { "x": 195.0 + apart / 2.0, "y": 300, "id": 2 }]);
    let mut touch = |kind: &str, points| {
        page.call(
            "Input.dispatchTouchEvent",
            json!({ "type": kind, "touchPoints": points }),
        );
    };
    touch("touchStart", fingers(100.0));
    for apart in [120.0, 150.0, 180.0, 200.0] {
        touch("touchMove", fingers(apart));
    }
    touch("touchEnd", json!([]));
    page.wait_for(&format!(
        "Math.abs(lattice.camera.distance / {before} - 0.5) < 0.01"
    ));
    // Folded, and open with all that it can show.
    stage.calibrated(&CalibrationResult {
        verdict: CalibrationResult::DEGENERATE,
        reason: "a long reason, as they are where a corridor leaves one direction open".to_owned(),
        ..CalibrationResult::default()
    });
    page.wait_for("!document.getElementById('headset').hidden");
    let outside = "[...document.querySelectorAll('#cameras, #cameras button, #compass, #panel, #panel *, #banner')] \
        .filter((part) => part.checkVisibility()).map((part) => [part.id || part.textContent, part.getBoundingClientRect()]) \
        .filter(([, box]) => box.left < -0.5 || box.right > 390.5).map(([name]) => name)";
    let wide = "document.documentElement.scrollWidth";
    for open in [false, true] {
        if open {
            page.value(
                "document.getElementById('fold').click(); \
                for (const part of document.querySelectorAll('#panel details')) part.open = true",
            );
            page.wait_for("!document.getElementById('sheet').hidden");
        }
        assert_eq!(page.value(outside), json!([]), "open: {open}");
        assert_eq!(page.value(wide), 390, "open: {open}");
    }
    assert_eq!(page.value("lattice.state.problems"), json!([]));
}
