//! `lattice paper`: reports that are complete, repeatable and readable.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::{error, text};

/// A page with the report's skeleton.
fn page(folder: &Path, body: &str) -> PathBuf {
    let path = folder.join("page.html");
    let head = "<!doctype html><html><head><link rel=\"icon\" href=\"data:,\"></head>";
    fs::write(&path, format!("{head}<body>{body}</body></html>")).unwrap();
    path
}

/// A report that was made.
struct Made {
    folder: PathBuf,
    report: Value,
}

impl Made {
    /// A quick report of a paper, in which all checks hold.
    fn new(paper: &str, folder: &Path, more: &[&str]) -> Made {
        let out = ["--out", folder.to_str().unwrap()];
        let words = text(&[&["paper", paper, "--quick"], &out[..], more].concat());
        let report = fs::read(folder.join("report.json")).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        let command = report["command"].as_str().unwrap();
        let scanned = more.contains(&"--scan");
        let scan = if scanned { " --scan target.ply" } else { "" };
        let expected = format!("lattice paper {paper} --seed 1 --quick{scan}");
        assert_eq!(command, expected);
        let folder = folder.to_owned();
        let made = Made { folder, report };
        let checks = made.all("checks");
        let failing: Vec<_> = checks.filter(|check| check["holds"] != true).collect();
        assert!(
            failing.is_empty() && !words.contains("fails: "),
            "{failing:?}"
        );
        made.is_complete();
        made
    }

    fn file(&self, name: &str) -> String {
        fs::read_to_string(self.folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    fn sections(&self) -> &[Value] {
        self.report["sections"].as_array().unwrap()
    }

    /// All checks, tables or figures.
    fn all<'a>(&'a self, list: &'a str) -> impl Iterator<Item = &'a Value> {
        let sections = self.sections().iter();
        sections.flat_map(move |section| section[list].as_array().unwrap())
    }

    fn ids(&self) -> Vec<&str> {
        let sections = self.sections().iter();
        sections.map(|s| s["id"].as_str().unwrap()).collect()
    }

    fn verdict(section: &Value) -> &str {
        section["verdict"]["verdict"].as_str().unwrap()
    }

    /// Every table and figure is there, and the page has all in itself.
    fn is_complete(&self) {
        for section in self.sections() {
            assert_ne!(Made::verdict(section), "not_reproduced", "{section}");
        }
        for (list, ending) in [("tables", "csv"), ("figures", "svg")] {
            for made_of in self.all(list) {
                let name = format!("{}.{ending}", made_of["name"].as_str().unwrap());
                assert!(!self.file(&name).is_empty(), "{name}");
            }
        }
        let html = self.file("report.html");
        for word in "<script|src=|@import|url(|href=\"http|>NaN| NaN|>inf| inf ".split('|') {
            assert!(!html.contains(word), "{word} in the page");
        }
    }

    /// Opens it in a browser, if there is one: no word on the console, nothing cut off or too wide.
    fn opens(&self) {
        let Some(chromium) = super::browser::chromium() else {
            return;
        };
        let opened = super::browser::open(&chromium, &self.folder.join("report.html"));
        assert_eq!(opened.console, Vec::<String>::new());
        let seen = opened.seen;
        assert_eq!(seen.others, Vec::<String>::new());
        assert_eq!(seen.ids, Vec::<String>::new());
        assert_eq!(seen.cut, Vec::<String>::new());
        assert!(
            seen.widths[1] <= seen.widths[0],
            "wider than the window: {:?}",
            seen.widths
        );
        assert_eq!(seen.figures.len(), self.all("figures").count());
        for (name, width, height) in &seen.figures {
            assert!(
                *width > 300.0 && *height > 150.0,
                "{name}: {width} x {height}"
            );
        }
    }
}

#[test]
fn a_quick_report_of_the_voxel_paper_holds_and_opens() {
    let folder = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let scan = data.join("pairs/small_gicp/target.ply");
    let has_scan = scan.exists();
    let more = ["--scan", scan.to_str().unwrap()];
    let made = Made::new("voxels", folder.path(), if has_scan { &more } else { &[] });
    let ids = made.ids();
    let expected = "fig1 quantization deltas generators distortion fig3 fig4 fig5 table1 fig6";
    for id in expected.split(' ') {
        assert!(ids.contains(&id), "{id}");
    }
    assert!(made.all("checks").count() > 300);
    made.opens();
    match has_scan {
        true => a_real_scan_saves_voxels_when_it_is_turned_anyhow(&made.file("fig5.csv")),
        false => drop(writeln!(
            std::io::stderr(),
            "SKIPPED: no {}",
            scan.display()
        )),
    }
}

fn a_real_scan_saves_voxels_when_it_is_turned_anyhow(rows: &str) {
    let row = |turned: &str, lattice: &str| -> Vec<f64> {
        let start = format!("scan target.ply,{turned},0.125,{lattice},");
        let row = rows.lines().find_map(|row| row.strip_prefix(&start));
        let row = row.unwrap_or_else(|| panic!("no {start} in {rows}"));
        row.split(',')
            .map(|cell| cell.parse().unwrap_or(f64::NAN))
            .collect()
    };
    // Another draw of rotations, elsewhere: 2848 voxels of cubic; FCC -5.0, BCC -5.3, MCC -4.9, hex
    // -1.5 %; about the vertical alone FCC takes more than cubic.
    let cubic = row("any rotation", "cubic");
    assert!((cubic[1] - 2848.0).abs() < 40.0, "{cubic:?}");
    for (lattice, change) in [("FCC", -5.0), ("BCC", -5.3), ("MCC", -4.9), ("hex", -1.5)] {
        let found = row("any rotation", lattice);
        assert!(
            (found[3] - change).abs() < found[4] + 0.3,
            "{lattice}: {found:?}"
        );
    }
    for lattice in ["FCC", "BCC"] {
        let found = row("any rotation", lattice);
        let (spread, mean) = (found[7], found[9]);
        assert!(
            (0.3..0.6).contains(&spread) && (-3.2..-1.5).contains(&mean),
            "{found:?}"
        );
    }
    let fcc = row("yaw only", "FCC");
    assert!(fcc[3] - fcc[4] > 0.0, "{fcc:?}");
}

#[test]
fn a_quick_report_of_the_calibration_paper_holds_and_opens() {
    let folder = tempfile::tempdir().unwrap();
    let made = Made::new("calibration", folder.path(), &["--threads", "3"]);
    let expected = "eq1-4 eq5-8 eq9 table1 claim fig3 fig4 fig2";
    assert_eq!(made.ids().join(" "), expected);
    for section in &made.sections()[..3] {
        assert_eq!(Made::verdict(section), "corrected", "{section}");
    }
    assert!(made.all("checks").count() > 35);
    // Both sides and their differences, of four scenes.
    let page = made.file("report.html");
    assert_eq!(page.matches("data:image/png;base64,").count(), 12);
    assert!(page.len() < 1_500_000, "{}", page.len());
    made.opens();
}

#[test]
fn a_page_with_faults_is_found_out() {
    let Some(chromium) = super::browser::chromium() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let good = "<figure id=\"a\"><svg width=\"400\" height=\"200\"><text x=\"9\" y=\"20\">in</text></svg></figure>\
                <a href=\"#a\">a</a>";
    let opened = super::browser::open(&chromium, &page(folder.path(), good));
    assert!(opened.console.is_empty(), "{opened:?}");
    let seen = opened.seen;
    assert!(
        seen.cut.is_empty() && seen.ids.is_empty() && seen.others.is_empty(),
        "{seen:?}"
    );
    assert_eq!(seen.figures, [("a".to_owned(), 400.0, 200.0)]);

    let bad = "<figure id=\"a\"><svg width=\"400\" height=\"0\"><text x=\"390\" y=\"20\">beyond</text></svg></figure>\
               <figure id=\"a\"></figure><a href=\"#none\">b</a><img src=\"none.png\">\
               <div style=\"width: 5000px\">wide</div><script>throw new Error(\"broken\")</script>";
    let opened = super::browser::open(&chromium, &page(folder.path(), bad));
    assert!(
        opened.console.iter().any(|line| line.contains("broken")),
        "{opened:?}"
    );
    let seen = opened.seen;
    assert_eq!(seen.cut, ["beyond"]);
    assert_eq!(seen.ids, ["a", "none"]);
    assert!(
        seen.others.iter().any(|name| name.ends_with("none.png")),
        "{seen:?}"
    );
    assert!(seen.widths[1] > seen.widths[0]);
    let sizes: Vec<_> = seen
        .figures
        .iter()
        .map(|figure| (figure.1, figure.2))
        .collect();
    assert_eq!(sizes, [(400.0, 0.0), (0.0, 0.0)]);
}

#[test]
fn what_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (option, path) in [("--scan", "/nowhere/scan.ply"), ("--bag", "/nowhere/log")] {
        let out = folder.path().join("none").display().to_string();
        let arguments = ["paper", "voxels", "--quick", option, path, "--out", &out];
        let words = error(&arguments);
        assert!(words.contains(path), "{words}");
    }
}
