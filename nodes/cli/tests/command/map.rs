//! `lattice map merge`, `diff`, `crop` and `query` as a user runs them.

use std::path::Path;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::{MapContents, write_map};
use nalgebra::Vector3;

use crate::{error, json, lattice, text};

/// The map of points in the map frame, with the datum near a place.
pub fn map(kind: LatticeKind, datum_m: [f64; 3], points_m: &[[f32; 3]]) -> VoxelList {
    let lattice = Lattice::new(kind, 0.125).unwrap();
    let mut list = VoxelList::new(lattice, datum_m.into(), usize::MAX).unwrap();
    list.insert(&Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m: points_m.to_vec(),
    });
    list
}

pub fn save(directory: &Path, name: &str, list: &VoxelList) -> String {
    let path = directory.join(name);
    write_map(list, std::fs::File::create(&path).unwrap()).unwrap();
    path.display().to_string()
}

fn load(path: &str) -> MapContents {
    MapContents::read(&std::fs::read(path).unwrap()[..], usize::MAX).unwrap()
}

fn points(range: std::ops::Range<i32>) -> Vec<[f32; 3]> {
    let point = |i: i32| [0.21 * i as f32, 0.4 * (i % 9) as f32, -0.3 * (i % 5) as f32];
    range.map(point).collect()
}

#[test]
fn maps_merge_differ_and_are_cut() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (first, second) = (points(-50..120), points(80..200));
    let save = |name: &str, list: &VoxelList| save(directory.path(), name, list);
    let a = save("a", &map(LatticeKind::Fcc, [0.0; 3], &first));
    // The same cells counted from elsewhere.
    let far_m = [300.0, -20.0, 7.0];
    let b = save("b", &map(LatticeKind::Fcc, far_m, &second));
    let whole = map(LatticeKind::Fcc, [0.0; 3], &[&first[..], &second].concat());
    let (a_keys, whole_keys) = (load(&a), MapContents::from_list(&whole));

    let merged = at("merged");
    let written = json(&["map", "merge", &a, &b, "-o", &merged]);
    assert_eq!(written["voxels"], whole.len());
    assert_eq!(written["points"], 290);
    assert_eq!(
        written["file_bytes"],
        std::fs::metadata(&merged).unwrap().len()
    );
    assert_eq!(load(&merged).keys(), whole_keys.keys());

    let rest = at("rest");
    let counts = json(&["map", "diff", &merged, &a, "-o", &rest]);
    assert_eq!(counts["only_a"], whole.len() - a_keys.keys().len());
    assert_eq!(
        (&counts["only_b"], &counts["both"]),
        (&0.into(), &a_keys.keys().len().into())
    );
    assert_eq!(json(&["map", "diff", &b, &rest])["only_b"], 0);
    assert_eq!(json(&["map", "diff", &a, &rest])["both"], 0);
    let again = at("again");
    let small = ["-o", &again, "--occupancy-only", "--zstd=19"];
    json(&[&["map", "merge", &a, &rest], &small[..]].concat());
    assert_eq!(load(&again).keys(), whole_keys.keys());
    assert!(load(&again).voxels().is_none());
    let info = json(&["map", "info", &again]);
    assert_eq!(info["counts"], false);
    text(&["map", "export", &again, "-o", &at("again.ply")]);

    let (left, right) = (at("left"), at("right"));
    let (low, high) = (["-1e3", "-1e3", "-2"], ["1e3", "1e3", "2"]);
    let boxed = |min: [&str; 3], max: [&str; 3], out: &str| {
        let sides = [&["--min"], &min[..], &["--max"], &max[..]].concat();
        json(&[&["map", "crop", &merged, "-o", out, "--zstd"], &sides[..]].concat())
    };
    let cut = boxed(low, ["7.5", high[1], high[2]], &left);
    let other = boxed(["7.5", low[1], low[2]], high, &right);
    let points = |cropped: &serde_json::Value| cropped["points"].as_u64().unwrap();
    let all = whole.distortion().points;
    assert_eq!(points(&cut) + points(&other), all);
    let (cut, other) = (cut["voxels"].as_u64(), other["voxels"].as_u64());
    assert!(cut > Some(10) && other > Some(10));
    assert_eq!(cut.unwrap() + other.unwrap(), whole.len() as u64);
    let left = load(&left);
    assert!(left.keys().iter().all(|key| left.center_m(*key).x < 7.5));
    for (key, voxel) in left.keys().iter().zip(left.voxels().unwrap()) {
        assert_eq!(voxel.count, whole.get(*key).unwrap().count);
    }
}

#[test]
fn what_does_not_go_together_is_refused_in_a_line() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let saved = |name: &str, kind, datum_m: [f64; 3]| {
        let mut list = map(kind, datum_m, &[]);
        list.insert(&Cloud {
            stamp_ns: 0,
            datum_m: datum_m.into(),
            offsets_m: points(0..9),
        });
        save(directory.path(), name, &list)
    };
    let fcc = saved("fcc", LatticeKind::Fcc, [0.0; 3]);
    let hex = saved("hex", LatticeKind::Hex, [0.0; 3]);
    let far = saved("far", LatticeKind::Fcc, [1e7, 0.0, 0.0]);
    let out = at("out");
    for command in [
        vec!["merge", &fcc, &hex, "-o", &out],
        vec!["diff", &fcc, &hex],
    ] {
        let line = error(&[&["map"], &command[..]].concat());
        assert!(
            line.contains(&hex) && line.contains("same lattice"),
            "{line}"
        );
    }
    let line = error(&["map", "merge", &fcc, &far, "-o", &out]);
    assert!(line.contains(&far) && line.contains("datum"), "{line}");
    let bare = at("bare");
    json(&["map", "merge", &fcc, "-o", &bare, "--occupancy-only"]);
    let line = error(&["map", "merge", &fcc, &bare, "-o", &out]);
    assert!(line.contains("occupancy only"), "{line}");
    let sides = ["--min", "0", "0", "0", "--max", "1", "0", "1"];
    let line = error(&[&["map", "crop", &fcc, "-o", &out], &sides[..]].concat());
    assert!(line.contains("--max"), "{line}");
    let mut bytes = std::fs::read(&fcc).unwrap();
    bytes.pop();
    std::fs::write(&fcc, &bytes).unwrap();
    let line = error(&["map", "merge", &fcc, "-o", &out]);
    assert!(line.contains("cut short") && line.contains(&fcc), "{line}");
    assert!(!Path::new(&out).exists());
    let nowhere = at("no/where");
    assert!(error(&["map", "merge", &hex, "-o", &nowhere]).contains(&nowhere));
}

#[test]
fn maps_answer_questions() {
    let directory = tempfile::tempdir().unwrap();
    // A wall at x = 2 with a gap above y = 3.
    let wall = |i: i32| [2.0, 0.1 * (i % 80 - 50) as f32, 0.1 * (i / 80 - 20) as f32];
    let cells: Vec<_> = (0..80 * 40).map(wall).collect();
    let list = map(LatticeKind::Cubic, [0.0; 3], &cells);
    let path = save(directory.path(), "wall", &list);
    let ask = |rest: &[&str]| json(&[&["map", "query", &path], rest].concat());
    let near = ask(&["--nearest", "1", "0", "0", "-k", "3"]);
    let near = near["nearest"].as_array().unwrap();
    assert_eq!(near.len(), 3);
    assert_eq!(near[0]["center_m"], serde_json::json!([2.0, 0.0, 0.0]));
    assert_eq!(
        (&near[0]["distance_m"], &near[1]["distance_m"]),
        (&1.0.into(), &1.25_f64.sqrt().into())
    );
    let none = lattice(&["map", "query", &path, "--nearest", "1", "0", "0", "-k", "0"]);
    let told = String::from_utf8_lossy(&none.stderr).into_owned();
    assert!(
        !none.status.success() && told.contains("0 is not in 1.."),
        "{told}"
    );
    let clear = ask(&["--clearance", "1", "0", "-0.1"]);
    assert_eq!(clear["clearance"]["distance_m"], 0.75);
    let inside = ask(&["--clearance", "2", "0", "0"]);
    assert_eq!(inside["clearance"]["distance_m"], 0.0);
    let ends = ["--path", "0", "0", "0", "4", "0", "0", "--radius", "0.3"];
    let way = &ask(&ends)["path"];
    let length_m = way["length_m"].as_f64().unwrap();
    assert!((7.0..9.0).contains(&length_m), "{length_m}");
    let centers = way["centers_m"].as_array().unwrap();
    assert_eq!(
        centers.first().unwrap(),
        &serde_json::json!([0.0, 0.0, 0.0])
    );
    assert_eq!(centers.last().unwrap(), &serde_json::json!([4.0, 0.0, 0.0]));
    let plain = text(&["map", "query", &path, "--nearest", "1", "0", "0"]);
    assert_eq!(plain, "1.000 m to the cell at 2.000 0.000 0.000\n");
    let blocked = [
        "map", "query", &path, "--path", "2", "0", "0", "4", "0", "0", "--radius", "0",
    ];
    assert!(error(&blocked).contains("not passable"));
    let nothing = lattice(&["map", "query", &path]);
    assert!(!nothing.status.success());
}

#[test]
fn a_grid_is_written_as_map_server_reads_it() {
    let directory = tempfile::tempdir().unwrap();
    let side = |i: u16| 0.2 * f32::from(i);
    let floor = (0..50).flat_map(|x| (0..30).map(move |y| [side(x), side(y), 0.0]));
    let wall = (0..30).flat_map(|y| (0..10).map(move |z| [5.0, side(y), side(z)]));
    let points: Vec<_> = floor.chain(wall).collect();
    let file = save(
        directory.path(),
        "site",
        &map(LatticeKind::Fcc, [0.0; 3], &points),
    );
    let yaml = directory.path().join("it's a site.yaml");
    let yaml_name = yaml.display().to_string();
    let robot = ["--robot", "1", "1", "0.3"];
    let written = text(&[&["map", "export", &file, "--grid", &yaml_name], &robot[..]].concat());
    assert!(written.contains("cells of 0.500 m"), "{written}");
    let said = std::fs::read_to_string(&yaml).unwrap();
    let said = |key: &str| {
        let mut lines = said.lines().filter_map(|line| line.split_once(": "));
        lines.find(|(name, _)| *name == key).unwrap().1.to_owned()
    };
    let number = |key: &str| said(key).parse::<f64>().unwrap();
    assert_eq!(
        (said("mode"), said("negate")),
        ("trinary".to_owned(), "0".to_owned())
    );
    assert_eq!(said("image"), "'it''s a site.pgm'");
    let origin = said("origin");
    let origin: Vec<f64> = origin
        .trim_matches(['[', ']'])
        .split(", ")
        .map(|v| v.parse().unwrap())
        .collect();
    let image = std::fs::read(yaml.with_extension("pgm")).unwrap();
    let mut lines = image.splitn(4, |byte| *byte == b'\n');
    assert_eq!(lines.next(), Some(&b"P5"[..]));
    let size = String::from_utf8(lines.next().unwrap().to_vec()).unwrap();
    let (width, height) = size.split_once(' ').unwrap();
    let [width, height] = [width, height].map(|text| text.parse::<usize>().unwrap());
    assert_eq!(lines.next(), Some(&b"255"[..]));
    let pixels = lines.next().unwrap();
    assert_eq!(pixels.len(), width * height);
    // As map_server takes a pixel: 1 occupied, 0 free, None unknown.
    let at = |x_m: f64, y_m: f64| {
        let resolution_m = number("resolution");
        let [x, y] = [(x_m, 0), (y_m, 1)]
            .map(|(at_m, axis)| ((at_m - origin[axis]) / resolution_m) as usize);
        let grey = pixels[(height - 1 - y) * width + x];
        let occupied = f64::from(255 - grey) / 255.0;
        match occupied {
            high if high > number("occupied_thresh") => Some(1),
            low if low < number("free_thresh") => Some(0),
            _ => None,
        }
    };
    assert_eq!(
        [at(2.0, 3.0), at(5.0, 3.0), at(8.0, 3.0)],
        [Some(0), Some(1), None]
    );
    let refused = error(&["map", "export", &file, "--grid", "site.png"]);
    assert!(refused.contains(".yaml"), "{refused}");
    let refused = error(&[
        "map",
        "export",
        &file,
        "--grid",
        &yaml_name,
        "--max-step",
        "0",
    ]);
    assert!(refused.contains("0.001..=100"), "{refused}");
    let refused = error(&[
        "map", "export", &file, "--grid", &yaml_name, "--robot", "1", "1", "-9",
    ]);
    assert!(refused.contains("no free cell"), "{refused}");
}

/// Arguments that ask for a path on the ground of a map.
fn ground_path<'a>(file: &'a str, goal: [&'a str; 3], rest: &[&'a str]) -> Vec<&'a str> {
    let start = ["map", "query", file, "--ground-path", "2", "2", "0.3"];
    [&start[..], &goal, rest].concat()
}

#[test]
fn a_path_on_the_ground_goes_round_a_wall() {
    let directory = tempfile::tempdir().unwrap();
    let side = |i: u16| 0.2 * f32::from(i);
    let floor = (0..50).flat_map(|x| (0..60).map(move |y| [side(x), side(y), 0.0]));
    let wall = (0..30).flat_map(|y| (0..10).map(move |z| [5.0, side(y), side(z)]));
    let points: Vec<_> = floor.chain(wall).collect();
    let list = map(LatticeKind::Fcc, [0.0; 3], &points);
    let file = save(directory.path(), "site", &list);
    let goal = ["8", "2", "0.3"];
    let way = &json(&ground_path(&file, goal, &[]))["path"];
    let corners = way["centers_m"].as_array().unwrap();
    let corners = corners.iter().map(|at| at.as_array().unwrap());
    let corners: Vec<Vec<f64>> = corners
        .map(|at| at.iter().map(|value| value.as_f64().unwrap()).collect())
        .collect();
    assert!((3..9).contains(&corners.len()), "{corners:?}");
    assert!(corners.iter().any(|at| at[1] > 6.3), "{corners:?}");
    assert!(corners.iter().all(|at| at[2].abs() < 0.05), "{corners:?}");
    let length_m = way["length_m"].as_f64().unwrap();
    assert!((12.0..14.5).contains(&length_m), "{length_m}");
    let refused = error(&ground_path(&file, goal, &["--robot-radius", "3"]));
    assert!(refused.contains("no room for a radius of 3 m"), "{refused}");
    let refused = error(&ground_path(&file, ["80", "2", "0.3"], &[]));
    assert!(refused.contains("goal [80.00, 2.00, 0.30]"), "{refused}");
    let alone = ["--nearest", "1", "0", "0", "--max-step", "1"];
    let refused = lattice(&[&["map", "query", &file], &alone[..]].concat());
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && told.contains("--ground-path"),
        "{told}"
    );
}
