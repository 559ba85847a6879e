//! The page at the sizes of a desktop and a phone, dark and light: nothing lies over anything else, nothing is cut off.

use lattice_msgs::geometry_msgs::Vector3;
use lattice_msgs::lattice::{CalibrationResult, WeakDirection};
use serde_json::json;

use crate::browser::chromium;
use crate::browser::devtools::Page;
use crate::browser::stage::{Known, Stage};

/// Names of parts that lie over each other, and of those that are cut off or outside of the window. Parts are words,
/// controls and drawings that a person sees; of what scrolls only what is in sight.
const FAULTS: &str = r#"(() => {
  const seen = (element) => element.checkVisibility({ visibilityProperty: true });
  const boxes = [];
  const take = (name, element, box, within) => {
    // What is scrolled out of sight is not there.
    let { left, right, top, bottom } = box;
    for (let at = element; at && at !== document.body; at = at.parentElement) {
      if (!/auto|scroll|hidden/.test(getComputedStyle(at).overflow) || at.tagName === "INPUT") continue;
      const clip = at.getBoundingClientRect();
      [left, right, top, bottom] = [Math.max(left, clip.left), Math.min(right, clip.right), Math.max(top, clip.top), Math.min(bottom, clip.bottom)];
    }
    if (right - left > 1 && bottom - top > 1) boxes.push({ name, element, left, right, top, bottom, within });
  };
  const panes = [..."banner nothing compass cameras panel".split(" ")].map((id) => document.getElementById(id)).filter(seen);
  for (const pane of panes) take(`#${pane.id}`, pane, pane.getBoundingClientRect(), null);
  const faults = [];
  for (const pane of panes) {
    for (const element of pane.querySelectorAll("*")) {
      if (!seen(element)) continue;
      if (/^(BUTTON|INPUT|SELECT|SVG)$/i.test(element.tagName)) take(element.id || element.tagName, element, element.getBoundingClientRect(), pane);
      if (/^(SELECT|OPTION)$/.test(element.tagName)) continue;
      for (const node of element.childNodes) {
        if (node.nodeType !== Node.TEXT_NODE || !node.textContent.trim()) continue;
        const range = document.createRange();
        range.selectNodeContents(node);
        for (const box of range.getClientRects()) take(`"${node.textContent.trim()}"`, element, box, pane);
      }
      const { overflow, textOverflow } = getComputedStyle(element);
      if (element.scrollWidth > element.clientWidth + 1 && element.clientWidth > 0 && textOverflow !== "ellipsis" && getComputedStyle(element).display !== "inline") {
        faults.push(`${element.id || element.tagName} "${element.textContent.trim().slice(0, 30)}" is cut off`);
      }
    }
  }
  for (const { name, left, right, top, bottom } of boxes) {
    if (left < -0.5 || top < -0.5 || right > innerWidth + 0.5 || bottom > innerHeight + 0.5) faults.push(`${name} is outside`);
  }
  boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
    if (a.element.contains(b.element) || b.element.contains(a.element)) return;
    const over = Math.min(Math.min(a.right, b.right) - Math.max(a.left, b.left), Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top));
    if (over > 1) faults.push(`${a.name} and ${b.name} by ${over.toFixed(1)} px`);
  }));
  return faults;
})()"#;

/// Cells with thirty labels.
fn many_labels() -> Vec<Known> {
    let cell = |i: i32| Known::new([4 * (i % 6), 4 * (i / 6), i], 1 << (i % 12), i as u16);
    (0..30).map(cell).collect()
}

/// A stage with all that the page can show at a time.
fn full_stage(cells: &[Known]) -> Stage {
    let stage = Stage::live(cells);
    let long = "a class with a name that is long, as they are in catalogues of things";
    let names: Vec<(u16, &str)> = (0..20)
        .map(|label| (label, if label % 4 == 0 { long } else { "wall" }))
        .collect();
    stage.names(&names);
    stage.robot_at([3.0, 4.0, 0.5]);
    let mut result = CalibrationResult {
        verdict: CalibrationResult::DEGENERATE,
        reason: "the walls of a corridor leave the direction along it open".to_owned(),
        ..CalibrationResult::default()
    };
    result.transform.rotation.w = 1.0;
    result.weak_directions = vec![WeakDirection {
        axis: Vector3 {
            x: 1.0,
            ..Vector3::default()
        },
        kind: WeakDirection::TRANSLATION,
        sigma: 3.0,
    }];
    stage.calibrated(&result);
    stage
}

/// States a log that plays, and a node that waits.
fn states(stage: &Stage) {
    let log = [
        ("begin_ns", "1317380000000000000"),
        ("end_ns", "1317387205000000000"),
        ("now_ns", "1317383602500000000"),
        ("rate", "1"),
        ("paused", "true"),
    ];
    stage.state("bag_player: log", 0, "paused", &log);
    let why = "0 of 390 poses are usable: the orientation covariance of /ins/odometry is -1 in its first element";
    let values = [("clouds_not_in_order", "12"), ("poses_refused", "390")];
    stage.state("robot/enu_transformer: clouds", 1, why, &values);
}

fn sized(page: &mut Page, width: u32, phone: bool) {
    let size = json!({ "width": width, "height": 800, "deviceScaleFactor": 1, "mobile": phone });
    page.call("Emulation.setDeviceMetricsOverride", size);
}

/// No faults, with the panel open (and all in it) and folded, scrolled to either end.
fn check(page: &mut Page, place: &str) {
    for open in [true, false] {
        page.value(&format!(
            "document.getElementById('sheet').hidden === {open} && document.getElementById('fold').click(); lattice.frame()"
        ));
        for share in [0.0, 0.5, 1.0] {
            page.value(&format!(
                "(() => {{ const sheet = document.getElementById('sheet'); sheet.scrollTop = {share} * sheet.scrollHeight; }})()"
            ));
            let faults = page.value(FAULTS);
            assert_eq!(faults, json!([]), "{place}, open: {open}, {share} down");
        }
    }
}

#[test]
fn nothing_overlaps_at_either_size_dark_or_light() {
    let Some(chromium) = chromium() else { return };
    let stage = full_stage(&many_labels());
    let mut page = Page::open(&chromium, "about:blank");
    for (width, phone) in [(1280, false), (390, true)] {
        sized(&mut page, width, phone);
        page.go("about:blank");
        page.go(&stage.url);
        page.wait_for("lattice.state.open && lattice.state.complete && lattice.state.robot && !document.getElementById('headset').hidden");
        states(&stage);
        page.wait_for("!document.getElementById('player').hidden");
        page.value(
            "for (const part of document.querySelectorAll('#panel details')) part.open = true",
        );
        for theme in ["dark", "light"] {
            for mode in ["height", "count", "label", "age"] {
                page.value(&format!(
                    "(() => {{ const colour = document.getElementById('colour'); colour.value = '{mode}'; \
                     colour.dispatchEvent(new Event('change')); }})()"
                ));
                check(&mut page, &format!("{width} px, {theme}, by {mode}"));
            }
            page.value("document.getElementById('theme').click()");
        }
        // A banner, as when nothing comes any more.
        page.wait_for("!document.getElementById('banner').hidden");
        check(&mut page, &format!("{width} px, with a banner"));
        // An empty map, with the cause.
        stage.replace(&[]);
        states(&stage);
        page.wait_for("!document.getElementById('nothing').hidden");
        check(&mut page, &format!("{width} px, empty"));
        stage.replace(&many_labels());
        assert_eq!(page.value("lattice.state.problems"), json!([]));
    }
}
