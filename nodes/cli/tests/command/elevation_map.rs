//! `lattice map export --elevation-map`, read by tifffile.

use std::io::{Write, stderr};
use std::process::Command;

use lattice_core::lattice::LatticeKind;
use serde_json::Value;

use crate::map::{map, save};
use crate::{error, lattice, python, text};

/// Prints the tags and pixels of a file as JSON, with null for NaN.
const READER: &str = r#"
import json, sys
try:
    import tifffile
except ModuleNotFoundError:
    sys.exit(3)
with tifffile.TiffFile(sys.argv[1]) as file:
    page = file.pages[0]
    data = page.asarray()
    tags = page.geotiff_tags
    print(json.dumps({
        "pages": len(file.pages),
        "type": str(data.dtype),
        "scale": tags["ModelPixelScale"],
        "tiepoint": tags["ModelTiepoint"],
        "raster": int(tags["GTRasterTypeGeoKey"]),
        "model": int(tags["GTModelTypeGeoKey"]),
        "citation": tags["GTCitationGeoKey"],
        "nodata": str(page.nodata),
        "names": page.tags["GDAL_METADATA"].value,
        "pixels": [[[None if v != v else float(v) for v in p] for p in row] for row in data],
    }))
"#;

/// File as tifffile has it; `None` without tifffile.
fn read(file: &str) -> Option<Value> {
    let found = Command::new(python()?)
        .args(["-c", READER, file])
        .output()
        .unwrap();
    if found.status.code() == Some(3) {
        let _ = writeln!(stderr(), "SKIPPED: LATTICE_PYTHON has no tifffile");
        return None;
    }
    let said = String::from_utf8_lossy(&found.stderr);
    assert!(found.status.success(), "{said}");
    Some(serde_json::from_slice(&found.stdout).unwrap())
}

/// Arguments that write heights.
fn export<'a>(file: &'a str, rest: &[&'a str]) -> Vec<&'a str> {
    [&["map", "export", file, "--elevation-map"], rest].concat()
}

#[test]
fn heights_are_where_a_foreign_reader_looks_for_them() {
    let directory = tempfile::tempdir().unwrap();
    // Ground that rises to the east, a wall across it, and ground that the robot does not reach.
    let side = |i: u16| 0.2 * f32::from(i);
    let height_m = |x_m: f32| 0.1 * x_m - 3.0;
    let floor = (0..50)
        .flat_map(|x| (0..30).map(move |y| [side(x) - 2.0, side(y), height_m(side(x) - 2.0)]));
    let wall = (0..30).flat_map(|y| (0..10).map(move |z| [5.0, side(y), side(z) + height_m(5.0)]));
    let points: Vec<_> = floor.chain(wall).collect();
    let list = map(LatticeKind::Fcc, [0.0; 3], &points);
    let file = save(directory.path(), "site", &list);
    let tif = directory.path().join("site.tif").display().to_string();
    let robot = ["--robot", "1", "1", "-2.5"];
    let written = text(&export(&file, &[&[&*tif], &robot[..]].concat()));
    assert!(written.contains("cells of 0.500 m"), "{written}");

    let refused = error(&export(&file, &["site.png"]));
    assert!(refused.contains(".tif"), "{refused}");
    let refused = error(&export(&file, &[&tif, "--robot", "1", "1", "-9"]));
    assert!(refused.contains("no free cell"), "{refused}");
    let both = lattice(&export(&file, &[&tif, "--grid", "site.yaml"]));
    let said = String::from_utf8_lossy(&both.stderr).into_owned();
    assert!(said.contains("cannot be used with '--grid"), "{said}");

    let Some(found) = read(&tif) else {
        return;
    };
    assert_eq!(
        (&found["pages"], &found["type"]),
        (&1.into(), &"float32".into())
    );
    assert_eq!(
        (&found["raster"], &found["model"]),
        (&1.into(), &32767.into())
    );
    assert_eq!(
        (&found["nodata"], &found["citation"]),
        (&"nan".into(), &"map frame, metres".into())
    );
    let names = found["names"].as_str().unwrap();
    let places = ["elevation", "slope", "step", "clearance", "traversability"]
        .map(|name| names.find(&format!(">{name}<")).unwrap());
    assert!(places.is_sorted(), "{names}");
    let number = |key: &str, i: usize| found[key][i].as_f64().unwrap();
    let scale_m = number("scale", 0);
    assert_eq!((scale_m, number("scale", 1)), (0.5, 0.5));
    // As a reader of GeoTIFF has it: rows go down from the tie point.
    let at = |x_m: f64, y_m: f64| {
        let column = ((x_m - number("tiepoint", 3)) / scale_m) as usize;
        let row = ((number("tiepoint", 4) - y_m) / scale_m) as usize;
        let pixel = found["pixels"][row][column].as_array().unwrap();
        pixel.iter().map(Value::as_f64).collect::<Vec<_>>()
    };
    for [x_m, y_m] in [[0.25, 1.25], [2.75, 1.25], [2.75, 4.75]] {
        let pixel = at(x_m, y_m);
        let z_m = pixel[0].unwrap() + 3.0 - 0.1 * x_m;
        assert!(z_m.abs() < 0.04, "{x_m} {y_m}: {pixel:?}");
        assert!((pixel[1].unwrap() - 0.1).abs() < 0.04, "{pixel:?}");
        assert!(pixel[2].unwrap() < 0.1, "{pixel:?}");
        assert_eq!(pixel[3], None, "{pixel:?}");
        assert!((0.5..0.8).contains(&pixel[4].unwrap()), "{pixel:?}");
    }
    assert_eq!(at(5.0, 3.0)[4], Some(0.0), "the wall");
    assert_eq!(at(6.75, 3.0)[4], None, "not reached");
}
