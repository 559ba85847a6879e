//! Point files of all kinds, and cells by their size, as a user has them.

use std::fs;
use std::io::{BufRead, BufReader, Write, stderr};
use std::process::{Command, Stdio};

use crate::{error, json, lattice, text};

/// Output of `lattice view` until it serves the map.
fn shown(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
    command.args(["view", "--port", "0"]).args(arguments);
    let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut out = BufReader::new(process.stdout.take().unwrap());
    let mut said = String::new();
    while !said.contains("the map is at http://") {
        assert!(out.read_line(&mut said).unwrap() > 0, "{said}");
    }
    process.kill().unwrap();
    process.wait().unwrap();
    said
}

/// Lines of a wall of 20 x 10 m, a point every 0.1 m.
fn wall() -> String {
    let line = |i: u32| {
        format!(
            "{} 3.05 {}\n",
            0.1 * f64::from(i % 200),
            0.1 * f64::from(i / 200)
        )
    };
    (0..200 * 100).map(line).collect()
}

#[test]
fn a_cell_size_is_the_edge_of_the_cube_of_equal_volume() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (points, map, log) = (at("points.xyz"), at("map"), at("log"));
    fs::write(&points, wall()).unwrap();
    let quantize = ["quantize", &points, "--lattice", "bcc"];
    let rows = |more: &[&str]| json(&[&quantize[..], more].concat());
    let by_size = rows(&["--cell-size", "0.25", "--map-out", &map]);
    assert_eq!(by_size, rows(&["--cell-volume", "0.015625"]));
    assert_eq!(by_size[0]["cell_size_m"], 0.25);
    assert_ne!(by_size, rows(&[]));
    assert_eq!(rows(&[]), rows(&["--cell-size", "0.5"]));
    let info = json(&["map", "info", &map]);
    assert_eq!(
        (&info["cell_volume_m3"], &info["cell_size_m"]),
        (&0.015625.into(), &0.25.into())
    );
    assert!(text(&["map", "info", &map]).contains("cells of 0.015625 m^3 (cell size 0.2500 m)"));
    let both = ["--cell-size", "0.25", "--cell-volume", "0.1"];
    let refused = |more: &[&str]| {
        let output = lattice(&[&quantize[..], more].concat());
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let told = refused(&both);
    assert!(
        told.contains("--cell-size") && told.contains("--cell-volume"),
        "{told}"
    );
    assert!(refused(&["--cell-size", "0"]).contains("expected 0.001 to 1000 m"));

    json(&["simulate", "bobcat", "--out", &log, "--duration", "4"]);
    let replay = |more: &[&str]| json(&[&["replay", "--direct", &log], more].concat());
    let maps = [
        replay(&["--cell-size", "0.25"]),
        replay(&["--cell-volume", "0.015625"]),
        replay(&["-p", "cell_size_m:=0.25"]),
    ];
    assert_eq!(maps[0]["lattices"], maps[1]["lattices"]);
    assert_eq!(maps[0]["lattices"], maps[2]["lattices"]);
    assert_ne!(maps[0]["lattices"], replay(&[])["lattices"]);
    let both = ["-p", "cell_size_m:=0.25", "-p", "cell_volume_m3:=0.1"];
    let told = error(&[&["replay", "--direct", &log], &both[..]].concat());
    assert!(
        told.contains("cell_size_m") && told.contains("cell_volume_m3"),
        "{told}"
    );
}

#[test]
fn a_map_goes_through_pcd_and_an_octree() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (points, map) = (at("points.xyz"), at("map"));
    fs::write(&points, wall()).unwrap();
    let cells = ["--lattice", "cubic", "--cell-size", "0.3"];
    let quantize = |file: &str, out: &str| {
        let command = [&["quantize", file, "--map-out", out], &cells[..]].concat();
        json(&command)[0]["voxels"].as_u64().unwrap()
    };
    let voxels = quantize(&points, &map);
    assert_eq!(text(&["map", "export", &map, "-o", &at("map.pcd")]), "");
    let told = text(&["map", "export", &map, "-o", &at("map.bt")]);
    let exact = format!(
        "{} voxels of 0.15 m, half the cell size: each cell",
        8 * voxels
    );
    assert!(told.starts_with(&exact), "{told}");
    let with_log_odds = text(&["map", "export", &map, "-o", &at("map.ot")]);
    assert_eq!(with_log_odds, told);
    for file in ["map.pcd", "map.bt", "map.ot"] {
        let again = at(&format!("{file}.map"));
        assert_eq!(quantize(&at(file), &again), voxels, "{file}");
        let compared = json(&["map", "diff", &map, &again]);
        assert_eq!(compared["both"], voxels, "{file}");
    }
    let told = error(&["map", "export", &map, "--as", "mesh", "-o", &at("map.bt")]);
    assert!(told.contains("--as mesh writes .ply, no .bt"), "{told}");
    // Cells of an octree's own size fall between its voxels.
    let small = ["quantize", &at("map.bt"), "--cell-size", "0.15"];
    let output = lattice(&small);
    let warned = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success() && warned.contains("0.3 m or more"),
        "{warned}"
    );
}

#[test]
fn a_point_file_is_shown_in_cells_that_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let points = at("points.xyz");
    fs::write(&points, wall()).unwrap();
    for (more, told) in [
        (&[][..], "cell size 0.2000 m, chosen by extent"),
        (&["--cell-size", "0.4"][..], "cell size 0.4000 m"),
    ] {
        let shown = shown(&[&[points.as_str()], more].concat());
        assert!(
            shown.contains("20000 points, ") && shown.contains(told),
            "{shown}"
        );
    }
    text(&["quantize", &points, "--map-out", &at("map.xyz")]);
    let told = error(&["view", &at("map.xyz"), "--cell-size", "1"]);
    assert!(told.contains("--cell-size has no effect here"), "{told}");
}

#[test]
fn an_octree_of_octomap_is_read_voxel_by_voxel() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let office = format!("{data}/indoor/geb079.bt");
    if fs::metadata(&office).is_err() {
        let _ = writeln!(stderr(), "SKIPPED: {office} is not there");
        return;
    }
    // As octomap's own library counts them.
    let command = ["quantize", &office, "--lattice", "cubic"];
    let rows = json(&[&command[..], &["--cell-size", "0.16"]].concat());
    assert_eq!(rows[0]["points"], 185_673);
    assert_eq!(rows[0]["voxels"], 48_251);
    let shown = shown(&[&office]);
    assert!(
        shown.contains("cell size 0.1600 m, two voxels of the octree"),
        "{shown}"
    );
}
