//! Opens a page in headless Chromium: what it says on its console, and where its figures are.

pub mod devtools;
pub mod stage;

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde::Deserialize;
use wait_timeout::ChildExt;

const OPTIONS: &str = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run \
    --disable-background-networking --disable-component-update --disable-sync \
    --window-size=1400,1000 --enable-logging=stderr --dump-dom";

/// A page that is not there by then never will be.
const PATIENCE: Duration = Duration::from_secs(120);

/// The browser that `LATTICE_CHROMIUM` names, or `chromium` where it is installed; else this says on
/// standard error that the test is skipped.
pub fn chromium() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("LATTICE_CHROMIUM") {
        return Some(named.into());
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders)
        .map(|folder| folder.join("chromium"))
        .find(|path| path.is_file());
    if found.is_none() {
        let test = std::thread::current().name().unwrap_or_default().to_owned();
        // Not eprintln: the test harness would keep it to itself.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED {test}: no chromium found; install it or have LATTICE_CHROMIUM name one"
        );
    }
    found
}

/// A page that was opened.
#[derive(Debug)]
pub struct Opened {
    /// Lines of its console: messages, errors, warnings.
    pub console: Vec<String>,
    /// Sizes of its parts.
    pub seen: Seen,
}

/// Sizes of the page's parts, by its own script, pixels.
#[derive(Debug, Deserialize)]
pub struct Seen {
    /// Width of the window and of what is in it.
    pub widths: [f64; 2],
    /// Name, width and height of the picture of each figure.
    pub figures: Vec<(String, f64, f64)>,
    /// Words of pictures that are cut off at an edge.
    pub cut: Vec<String>,
    /// Ids that are there twice, and links to ids that are not there.
    pub ids: Vec<String>,
    /// Other files that it wants.
    pub others: Vec<String>,
}

/// Added to a copy of the page; it writes what is seen into the page's end.
const PROBE: &str = r##"
<script>
const all = (selector, root) => [...(root || document).querySelectorAll(selector)];
const ids = all("[id]").map((e) => e.id);
const outside = (text) => {
  const box = text.getBoundingClientRect();
  const svg = text.closest("svg").getBoundingClientRect();
  return box.left < svg.left - 1 || box.right > svg.right + 1 || box.top < svg.top - 1 || box.bottom > svg.bottom + 1;
};
const seen = {
  widths: [document.documentElement.clientWidth, document.documentElement.scrollWidth],
  figures: all("figure").map((figure) => {
    const svg = figure.querySelector("svg, img");
    const box = svg ? svg.getBoundingClientRect() : { width: 0, height: 0 };
    return [figure.id, box.width, box.height];
  }),
  cut: all("svg text").filter(outside).map((text) => text.textContent.trim()),
  ids: ids.filter((id, i) => ids.indexOf(id) !== i).concat(
    all("a[href^='#']").map((a) => a.getAttribute("href").slice(1)).filter((id) => !ids.includes(id))),
  others: all("[src], link[href], use[href], image[href]")
    .map((e) => e.getAttribute("src") || e.getAttribute("href"))
    .concat(performance.getEntriesByType("resource").map((entry) => entry.name))
    .filter((name) => !name.startsWith("data:") && !name.startsWith("#")),
};
const note = document.createElement("pre");
note.id = "seen-by-the-test";
note.textContent = JSON.stringify(seen);
document.body.append(note);
</script>
"##;

/// Opens a page as it is for its console, then a copy that notes the sizes of its parts.
pub fn open(chromium: &Path, page: &Path) -> Opened {
    let (_, console) = dump(chromium, page);
    let html = fs::read_to_string(page).unwrap();
    let copy = page.with_extension("seen.html");
    fs::write(&copy, html.replace("</body>", &format!("{PROBE}</body>"))).unwrap();
    let (dom, _) = dump(chromium, &copy);
    fs::remove_file(&copy).unwrap();
    let note = dom.split("id=\"seen-by-the-test\">").nth(1);
    let note = note.and_then(|rest| rest.split("</pre>").next());
    let note = note.unwrap_or_else(|| panic!("the page has no note of its parts: {dom}"));
    let note = note
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    Opened {
        console,
        seen: serde_json::from_str(&note).unwrap(),
    }
}

/// The page's elements once it has loaded, and the lines of its console.
fn dump(chromium: &Path, page: &Path) -> (String, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let [dom, log] = ["dom", "log"].map(|name| folder.path().join(name));
    let mut browser = Command::new(chromium)
        .args(OPTIONS.split_whitespace())
        .arg(format!(
            "--user-data-dir={}",
            folder.path().join("user").display()
        ))
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .stdout(File::create(&dom).unwrap())
        .stderr(File::create(&log).unwrap())
        .spawn()
        .unwrap_or_else(|e| panic!("{}: {e}", chromium.display()));
    let Some(status) = browser.wait_timeout(PATIENCE).unwrap() else {
        browser.kill().unwrap();
        panic!(
            "chromium did not end: {}",
            fs::read_to_string(&log).unwrap()
        );
    };
    let log = String::from_utf8_lossy(&fs::read(&log).unwrap()).into_owned();
    assert!(status.success(), "{status}: {log}");
    let console = log.lines().filter(|line| line.contains(":CONSOLE"));
    let console = console.map(str::to_owned).collect();
    (fs::read_to_string(&dom).unwrap(), console)
}
