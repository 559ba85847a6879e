//! The reader in `docs/map_file.md` reads what we write.

use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::process::Command;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_core::voxels::{Payload, VoxelList};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde_json::Value;

const PRINT: &str = r#"
import json, sys
for path in sys.argv[1:]:
    name, volume_m3, generator, datum, columns = read_map(path)
    centers = [center_m(generator, datum, key) for key, in columns["keys"]]
    print(json.dumps({"name": name, "volume": volume_m3, "datum": datum, "centers": centers, **columns}))
"#;

fn python() -> OsString {
    std::env::var_os("LATTICE_PYTHON").unwrap_or_else(|| "python3".into())
}

fn runs(arguments: &[&str]) -> bool {
    let output = Command::new(python()).args(arguments).output();
    let ok = output.is_ok_and(|output| output.status.success());
    if !ok {
        // Not eprintln: the test harness would keep it to itself.
        let _ = writeln!(std::io::stderr(), "SKIPPED: no python for {arguments:?}");
    }
    ok
}

/// The files as the reader of the description reads them.
fn read_by_python(directory: &Path, files: &[Vec<u8>]) -> Vec<Value> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/map_file.md");
    let docs = std::fs::read_to_string(docs).unwrap();
    let (_, code) = docs.split_once("```python\n").unwrap();
    let (code, _) = code.split_once("```").unwrap();
    assert!(code.lines().count() < 50, "{} lines", code.lines().count());
    let script = directory.join("read.py");
    std::fs::write(&script, [code, PRINT].concat()).unwrap();
    let paths: Vec<_> = (0..files.len())
        .map(|i| directory.join(format!("{i}")))
        .collect();
    for (path, file) in paths.iter().zip(files) {
        std::fs::write(path, file).unwrap();
    }
    let output = Command::new(python())
        .arg(&script)
        .args(&paths)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let lines = String::from_utf8(output.stdout).unwrap();
    lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn maps() -> Vec<MapContents> {
    let map = |lattice: Lattice| {
        let datum_m = Vector3::new(-4321.0, 98765.4, 12.0);
        let list = VoxelList::new(lattice, datum_m, usize::MAX).unwrap();
        let mut list = list.with_payload(Payload {
            stamps: true,
            labels: true,
            color: true,
        });
        let offset = |i: u32| {
            [
                0.13 * (i % 37) as f32,
                -0.29 * (i % 41) as f32,
                0.01 * i as f32,
            ]
        };
        list.insert(&Cloud {
            stamp_ns: 0,
            datum_m,
            offsets_m: (0..1000).map(offset).chain([[9e3, -9e3, 0.0]]).collect(),
        });
        MapContents::from_list(&list)
    };
    let named = LatticeKind::ALL.map(|kind| Lattice::new(kind, 0.02).unwrap());
    let turn = UnitQuaternion::from_euler_angles(0.3, -1.2, 2.5);
    let skewed = Matrix3::new(0.3, 0.1, 0.0, 0.0, 0.2, 0.1, 0.1, -0.1, 0.3);
    let custom = Lattice::from_basis(skewed).unwrap();
    let turned = [custom.clone(), named[2].clone()].map(|lattice| lattice.oriented(turn));
    let lattices = named.into_iter().chain([custom]).chain(turned);
    lattices.map(map).collect()
}

fn compare(zstd_level: Option<i32>, occupancy_only: bool) {
    let directory = tempfile::tempdir().unwrap();
    let options = WriteOptions {
        zstd_level,
        occupancy_only,
    };
    let write = |map: &MapContents| {
        let mut bytes = Vec::new();
        map.write(&mut bytes, &options).unwrap();
        bytes
    };
    let maps = maps();
    let files: Vec<_> = maps.iter().map(write).collect();
    let read = read_by_python(directory.path(), &files);
    assert_eq!(read.len(), maps.len());
    for (map, read) in maps.iter().zip(&read) {
        assert_eq!(read["name"], map.lattice().kind().name());
        // serde_json may read the last digit wrong.
        let volume_m3 = read["volume"].as_f64().unwrap();
        assert!((volume_m3 - map.lattice().cell_volume_m3()).abs() < 1e-15);
        assert_eq!(read["datum"], serde_json::json!(map.datum_index()));
        let keys: Vec<_> = map.keys().iter().map(|key| [key.raw()]).collect();
        assert_eq!(read["keys"], serde_json::json!(keys));
        let centers: Vec<[f64; 3]> = serde_json::from_value(read["centers"].clone()).unwrap();
        for (key, center) in map.keys().iter().zip(centers) {
            let error_m = (map.center_m(*key) - Vector3::from(center)).norm();
            assert!(error_m < 1e-9, "{error_m}");
        }
        let voxels = map.voxels().unwrap();
        if occupancy_only {
            assert_eq!(read.get("count"), None);
            continue;
        }
        let counts: Vec<_> = voxels.iter().map(|voxel| [voxel.count]).collect();
        assert_eq!(read["count"], serde_json::json!(counts));
        let sums: Vec<_> = voxels.iter().map(|voxel| voxel.sum).collect();
        assert_eq!(read["offset_sum"], serde_json::json!(sums));
    }
}

#[test]
fn the_python_of_the_description_reads_maps() {
    if runs(&["--version"]) {
        compare(None, false);
        compare(None, true);
    }
}

#[test]
fn the_python_of_the_description_reads_packed_maps() {
    if runs(&["-c", "import zstandard"]) {
        compare(Some(3), false);
    }
}

#[test]
fn the_python_of_the_description_refuses_a_cut_file() {
    if !runs(&["--version"]) {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let mut bytes = Vec::new();
    maps()[0]
        .write(&mut bytes, &WriteOptions::default())
        .unwrap();
    bytes.pop();
    let result = std::panic::catch_unwind(|| read_by_python(directory.path(), &[bytes]));
    let message = *result.unwrap_err().downcast::<String>().unwrap();
    assert!(message.contains("cut short or damaged"), "{message}");
}
