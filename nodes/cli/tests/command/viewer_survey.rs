//! Large maps in the page: what they take. `LATTICE_SURVEY=1` measures a survey that is repeated to millions of cells.

use std::fs;
use std::path::Path;
use std::time::Instant;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::MortonKey;
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::{MapContents, WriteOptions};

use crate::browser::{chromium, devtools::Page};
use crate::text;
use crate::viewer::{COMPLETE, Viewer};

const FRAMES: u32 = 5;
/// Draws as the page at rest does, and waits for the picture.
const DRAW: &str = "(() => { for (let i = 0; i < 5; i++) { lattice.frame(); \
    lattice.cells.gl.readPixels(0, 0, 1, 1, 6408, 5121, new Uint8Array(4)); } })()";
/// Bytes of all buffers of cells.
const BUFFERS: &str = "[...lattice.cells.tiles.values()].reduce((sum, tile) => sum + tile.room, 0)";

/// A site that a spinning scanner has surveyed.
fn survey(folder: &Path, points: &str) -> VoxelList {
    let path = |name: &str| folder.join(name).display().to_string();
    let (cloud, map) = (path("site.bin"), path("site.lattice"));
    let site = ["simulate", "site", "--pattern", "os64", "--points", points];
    text(&[&site[..], &["--out", &cloud]].concat());
    let cells = ["--lattice", "fcc", "--cell-volume", "0.0003"];
    text(&[&["quantize", &cloud][..], &cells, &["--map-out", &map]].concat());
    let file = fs::File::open(map).unwrap();
    let map = MapContents::read(std::io::BufReader::new(file), 1 << 23).unwrap();
    map.into_list(usize::MAX)
}

/// A map file of so many cells: the survey side by side, as often as it takes.
fn repeated(survey: &VoxelList, cells: usize, path: &Path) {
    let lattice = survey.lattice().clone();
    let sorted = survey.sorted();
    let indices: Vec<[i32; 3]> = sorted.iter().map(|(key, _)| key.unpack()).collect();
    let ends = indices.iter().map(|w| w[0]);
    let width = ends.clone().max().unwrap() - ends.min().unwrap() + 1;
    let shifted = (0..).flat_map(|copy| {
        indices
            .iter()
            .map(move |&[a, b, c]| [a + copy * width, b, c])
    });
    let center = |w| lattice.center(w).map(|x| x as f32).into();
    let mut list = VoxelList::new(lattice.clone(), survey.datum_m(), cells).unwrap();
    let datum_m = list.datum_m();
    list.insert(&Cloud {
        stamp_ns: 1,
        datum_m,
        offsets_m: shifted
            .take(cells)
            .inspect(|w| assert!(MortonKey::pack(*w).is_some()))
            .map(center)
            .collect(),
    });
    assert_eq!(list.len(), cells);
    let file = fs::File::create(path).unwrap();
    MapContents::from_list(&list)
        .write(file, &WriteOptions::default())
        .unwrap();
}

/// Memory (proportional, MB) and processor time (s) of a process and its descendants.
fn taken(root: u32) -> (f64, f64) {
    let stat = |pid: u32| fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // Behind the name, which may hold anything: state, parent; the 12th and 13th are times.
    let fields = |pid: u32| -> Vec<u64> {
        let stat = stat(pid);
        let rest = stat
            .rsplit(')')
            .next()
            .unwrap_or_default()
            .split_whitespace();
        rest.map(|field| field.parse().unwrap_or(0)).collect()
    };
    let all = fs::read_dir("/proc")
        .unwrap()
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    let all: Vec<(u32, Vec<u64>)> = all.map(|pid| (pid, fields(pid))).collect();
    let mut family = vec![root];
    let mut next = 0;
    while let Some(&parent) = family.get(next) {
        let children = all
            .iter()
            .filter(|(_, of)| of.get(1) == Some(&u64::from(parent)));
        family.extend(children.map(|(pid, _)| *pid));
        next += 1;
    }
    let kilobytes = |pid: &u32| -> f64 {
        let text = fs::read_to_string(format!("/proc/{pid}/smaps_rollup")).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("Pss:"));
        line.and_then(|line| line.split_whitespace().next()?.parse().ok())
            .unwrap_or(0.0)
    };
    let ticks = |pid: &u32| {
        let of = all.iter().find(|(other, _)| other == pid).map(|(_, of)| of);
        of.map_or(0, |of| of.get(11).unwrap_or(&0) + of.get(12).unwrap_or(&0))
    };
    let memory_mb = family.iter().map(kilobytes).sum::<f64>() / 1024.0;
    // Ticks of Linux are hundredths.
    let busy_s = family.iter().map(ticks).sum::<u64>() as f64 / 100.0;
    (memory_mb, busy_s)
}

#[test]
fn a_survey_that_is_repeated_is_whole_in_the_page() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (points, sizes) = match std::env::var_os("LATTICE_SURVEY") {
        Some(_) => ("6000000", vec![1_000_000, 2_000_000, 5_000_000]),
        None => ("20000", vec![40_000]),
    };
    let survey = survey(folder.path(), points);
    for cells in sizes {
        let map = folder.path().join(format!("{cells}.lattice"));
        repeated(&survey, cells, &map);
        let viewer = Viewer::start(&["view", &map.display().to_string(), "--port", "0"]);
        let mut page = Page::open(&chromium, "about:blank");
        let (before_mb, _) = taken(page.process());
        let begun = Instant::now();
        page.go(&viewer.url);
        page.wait_for(&format!("{COMPLETE} && lattice.state.size === {cells}"));
        let whole_s = begun.elapsed().as_secs_f64();
        page.value(DRAW);
        let (_, before_s) = taken(page.process());
        page.value(DRAW);
        let (page_mb, after_s) = taken(page.process());
        let (server_mb, _) = taken(viewer.process());
        let frame_s = (after_s - before_s) / f64::from(FRAMES);
        let figure = |page: &mut Page, of: &str| page.value(of).as_u64().unwrap();
        let drawn = figure(&mut page, "lattice.cells.drawn");
        let buffers_mb = figure(&mut page, BUFFERS) as f64 / 1e6;
        println!(
            "{cells} cells: whole after {whole_s:.1} s; a frame of {drawn} points takes {frame_s:.2} s of \
             processor time; buffers {buffers_mb:.1} MB; browser {page_mb:.0} MB ({before_mb:.0} MB when empty), \
             server {server_mb:.0} MB"
        );
        assert!(page.value("lattice.lit()").as_f64().unwrap() > 0.01);
        assert_eq!(page.value("lattice.state.problems"), serde_json::json!([]));
    }
}
