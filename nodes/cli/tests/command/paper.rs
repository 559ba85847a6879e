//! `lattice paper`: reports that are complete, repeatable and readable.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn lattice(arguments: &[&str], threads: &str, out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lattice"))
        .args(arguments)
        .arg("--out")
        .arg(out)
        .env("RAYON_NUM_THREADS", threads)
        .output()
        .unwrap()
}

fn good(output: &Output) -> String {
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}{errors}");
    words
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let read = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().unwrap();
        (name, fs::read(entry.path()).unwrap())
    };
    entries.map(read).collect()
}

/// A page with the report's skeleton.
fn page(folder: &Path, body: &str) -> PathBuf {
    let path = folder.join("page.html");
    let head = "<!doctype html><html><head><link rel=\"icon\" href=\"data:,\"></head>";
    fs::write(&path, format!("{head}<body>{body}</body></html>")).unwrap();
    path
}

/// A report that was made twice.
struct Made {
    folder: PathBuf,
    files: BTreeMap<String, Vec<u8>>,
    report: Value,
}

impl Made {
    /// A quick report of a paper, on one thread and on three: the same bytes, and all checks hold.
    fn new(paper: &str, folder: &Path, threads: [&[&str]; 2]) -> Made {
        let [one, three] = ["one", "three"].map(|name| folder.join(name));
        let quick = ["paper", paper, "--quick"];
        let [on_one, on_three] = threads.map(|more| [&quick, more].concat());
        let words = good(&lattice(&on_one, "1", &one));
        good(&lattice(&on_three, "3", &three));
        let made = files(&one);
        assert_eq!(
            made.keys().collect::<Vec<_>>(),
            files(&three).keys().collect::<Vec<_>>()
        );
        for (name, bytes) in files(&three) {
            assert!(
                made[&name] == bytes,
                "{name} depends on the number of threads"
            );
        }
        let report: Value = serde_json::from_slice(&made["report.json"]).unwrap();
        let command = format!("lattice paper {paper} --seed 1 --quick");
        assert_eq!(report["command"], command);
        let made = Made {
            folder: one,
            files: made,
            report,
        };
        let checks = made.all("checks");
        let failing: Vec<_> = checks.filter(|check| check["holds"] != true).collect();
        assert!(
            failing.is_empty() && !words.contains("fails: "),
            "{failing:?}"
        );
        made.is_complete();
        made
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
                assert!(self.files.contains_key(&name), "{name}");
            }
        }
        let html = String::from_utf8(self.files["report.html"].clone()).unwrap();
        for word in [
            "<script",
            "src=",
            "@import",
            "url(",
            "href=\"http",
            ">NaN",
            " NaN",
            ">inf",
            " inf ",
        ] {
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
fn a_quick_report_of_the_voxel_paper_is_repeatable_holds_and_opens() {
    let folder = tempfile::tempdir().unwrap();
    let made = Made::new("voxels", folder.path(), [&[], &[]]);
    let ids = made.ids();
    for id in [
        "fig1",
        "quantization",
        "deltas",
        "generators",
        "distortion",
        "fig3",
        "fig4",
        "fig5",
        "table1",
        "fig6",
    ] {
        assert!(ids.contains(&id), "{id}");
    }
    assert!(made.all("checks").count() > 300);
    made.opens();
}

#[test]
fn a_quick_report_of_the_calibration_paper_is_repeatable_holds_and_opens() {
    let folder = tempfile::tempdir().unwrap();
    let threads: [&[&str]; 2] = [&["--threads", "1"], &["--threads", "3"]];
    let made = Made::new("calibration", folder.path(), threads);
    assert_eq!(
        made.ids(),
        [
            "eq1-4", "eq5-8", "eq9", "table1", "claim", "fig3", "fig4", "fig2"
        ]
    );
    for section in &made.sections()[..3] {
        assert_eq!(Made::verdict(section), "corrected", "{section}");
    }
    assert!(made.all("checks").count() > 35);
    // Both sides and their differences, of four scenes.
    let page = String::from_utf8_lossy(&made.files["report.html"]);
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
fn a_real_scan_saves_voxels_when_it_is_turned_anyhow() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let scan = data.join("pairs/small_gicp/target.ply");
    if !scan.exists() {
        let _ = writeln!(std::io::stderr(), "SKIPPED: no {}", scan.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("scan");
    let scan = scan.to_str().unwrap();
    good(&lattice(
        &["paper", "voxels", "--quick", "--seed", "2", "--scan", scan],
        "2",
        &out,
    ));
    let rows = fs::read_to_string(out.join("fig5.csv")).unwrap();
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
    let fcc = row("yaw only", "FCC");
    assert!(fcc[3] - fcc[4] > 0.0, "{fcc:?}");
}

#[test]
fn what_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (option, path) in [("--scan", "/nowhere/scan.ply"), ("--bag", "/nowhere/log")] {
        let arguments = ["paper", "voxels", "--quick", option, path];
        let output = lattice(&arguments, "2", &folder.path().join("none"));
        let words = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && words.contains(path), "{words}");
    }
}
