//! Octrees against OctoMap's own library, and damaged ones.

use std::fs;
use std::path::Path;

use lattice_core::lattice::LatticeKind;
use lattice_core::raycast::{ClearOptions, Evidence};
use lattice_msgs::cdr;
use lattice_msgs::octomap_msgs::{GetOctomapResponse, Octomap};
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_nodes::files::export::write_octree;
use lattice_nodes::files::points::{PointFileOptions, read_points};
use lattice_nodes::lattice_mapper::{
    FreeSpaceMethod, LatticeMapper, MappedFreeSpace, MapperOptions,
};
use lattice_nodes::octree::OctreeForm;
use lattice_test::clouds::{cloud, field};
use lattice_test::maps;
use lattice_test::peer;
use lattice_test::python::python;
use lattice_test::random::Random;
use serde::Deserialize;
use serde_json::json;

const CELL_M: f64 = 0.25;
/// Log-odds of the sensor model, which are steps of 1/32.
const LOG_ODDS: [(&str, f64); 4] = [
    ("hit", 27.0 / 32.0),
    ("miss", -13.0 / 32.0),
    ("least", -2.0),
    ("most", 3.5),
];

fn evidence() -> Evidence {
    let [hit, miss, least, most] = LOG_ODDS.map(|(_, odds)| 1.0 / (1.0 + (-odds).exp()));
    Evidence {
        hit,
        miss,
        least,
        most,
        threshold: 0.5,
    }
}

/// A scan: the sensor, and points on the walls of a room and on a pillar that comes and goes.
struct Scan {
    origin: [f32; 3],
    points: Vec<[f32; 3]>,
}

fn scans() -> Vec<Scan> {
    let mut random = Random(7);
    let mut value = |low: f32, high: f32| low + (high - low) * random.unit() as f32;
    let mut scan = |i: usize| {
        let origin = [0.3 * i as f32 - 1.3, 0.4137, 0.2291];
        let mut points: Vec<[f32; 3]> = (0..200)
            .map(|_| match value(0.0, 3.0) as u32 {
                0 => [4.03, value(-3.0, 3.0), value(-1.5, 1.5)],
                1 => [value(-4.0, 4.0), 3.07, value(-1.5, 1.5)],
                _ => [value(-4.0, 4.0), value(-3.0, 3.0), -1.53],
            })
            .collect();
        if i.is_multiple_of(3) {
            points.extend((0..30).map(|_| [2.04, value(1.0, 1.6), value(-1.0, 1.0)]));
        }
        Scan { origin, points }
    };
    (0..9).map(&mut scan).collect()
}

/// The cloud of a scan in the frame of the map, with the place of the sensor.
fn message(scan: &Scan) -> PointCloud2 {
    let mut message = cloud("map", 1, &scan.points);
    let data = message.data.chunks_exact(12).flat_map(|point| {
        let sensor = scan.origin.map(f32::to_le_bytes);
        [point, sensor.as_flattened()].concat()
    });
    message.data = data.collect::<Vec<u8>>().into();
    for (at, name) in [(12, "vp_x"), (16, "vp_y"), (20, "vp_z")] {
        message.fields.push(field(name, at, PointField::FLOAT32));
    }
    message.point_step = 24;
    message.row_step = 24 * message.width;
    message
}

fn options(kind: LatticeKind) -> MapperOptions {
    MapperOptions {
        free_space: MappedFreeSpace {
            method: FreeSpaceMethod::Evidence,
            evidence: evidence(),
            // OctoMap's own rule.
            clear: ClearOptions {
                spare_touching: false,
                ..ClearOptions::default()
            },
            is_fine: true,
            ..MappedFreeSpace::default()
        },
        ..maps::options(kind, CELL_M.powi(3))
    }
}

fn mapper(kind: LatticeKind) -> LatticeMapper {
    let mut mapper = maps::mapper(options(kind));
    for scan in scans() {
        mapper.on_cloud(&message(&scan)).unwrap();
    }
    mapper
}

fn octomaps(mapper: &mut LatticeMapper) -> [(&'static str, Octomap); 2] {
    [("binary", OctreeForm::Binary), ("full", OctreeForm::Full)]
        .map(|(name, form)| (name, mapper.octomap(form).unwrap()))
}

fn bytes(octomap: &Octomap) -> Vec<u8> {
    octomap
        .data
        .iter()
        .map(|byte| byte.cast_unsigned())
        .collect()
}

#[derive(Deserialize)]
struct Compared {
    resolution: f64,
    voxels: usize,
    known: usize,
    wrong: usize,
    difference: f64,
}

#[derive(Deserialize)]
struct FileRead {
    voxels: usize,
    values: Vec<f64>,
}

#[derive(Deserialize)]
struct Found {
    cells: usize,
    occupied: usize,
    binary: Compared,
    full: Compared,
    #[serde(rename = "file.bt")]
    file_bt: FileRead,
    #[serde(rename = "file.ot")]
    file_ot: FileRead,
    centers: Vec<[f64; 3]>,
}

fn write_files(mapper: &LatticeMapper, folder: &Path) {
    for (name, form) in [
        ("file.bt", OctreeForm::Binary),
        ("file.ot", OctreeForm::Full),
    ] {
        let file = fs::File::create(folder.join(name)).unwrap();
        write_octree(mapper.list(), form, file).unwrap();
    }
}

#[test]
fn octomap_builds_the_same_tree_from_the_same_rays() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut mapper = mapper(LatticeKind::Cubic);
    let of_message = |octomap: &Octomap| {
        let hex: String = bytes(octomap).iter().map(|b| format!("{b:02x}")).collect();
        json!({"binary": octomap.binary, "id": octomap.id, "resolution": octomap.resolution, "data": hex})
    };
    let messages: serde_json::Map<_, _> = octomaps(&mut mapper)
        .iter()
        .map(|(name, octomap)| ((*name).to_owned(), of_message(octomap)))
        .collect();
    let scans: Vec<_> = scans()
        .iter()
        .map(|scan| json!({"origin": scan.origin, "points": scan.points}))
        .collect();
    let log_odds: serde_json::Map<_, _> = LOG_ODDS
        .map(|(name, odds)| (name.to_owned(), json!(odds)))
        .into_iter()
        .collect();
    let scene =
        json!({"cell_m": CELL_M, "log_odds": log_odds, "scans": scans, "messages": messages});
    fs::write(folder.path().join("scene.json"), scene.to_string()).unwrap();
    write_files(&mapper, folder.path());
    let found = peer::run(&python, "octree_peer.py", &[folder.path()]);
    let found: Found = serde_json::from_value(found).unwrap();

    let occupied = mapper.cells().len();
    assert!(occupied > 300 && found.cells > 5 * occupied, "{occupied}");
    assert_eq!(found.occupied, occupied);
    for compared in [&found.binary, &found.full] {
        assert_eq!(compared.resolution, CELL_M / 2.0);
        assert_eq!([compared.voxels, compared.known], [8 * found.cells; 2]);
        assert_eq!(compared.wrong, 0);
        assert!(compared.difference < 1e-4, "{}", compared.difference);
    }
    // A map file has no evidence; the library's upper bound is 0.971.
    assert_eq!(
        [found.file_bt.voxels, found.file_ot.voxels],
        [8 * occupied; 2]
    );
    assert_eq!(found.file_ot.values, [3.5]);
    assert!((found.file_bt.values[0] - 3.511).abs() < 0.01);

    // Theirs read by us.
    for name in ["theirs.bt", "theirs.ot"] {
        let file = read_points(&folder.path().join(name), &PointFileOptions::default()).unwrap();
        assert_eq!(file.voxel_m, Some(CELL_M));
        let mut centers = file.points_m;
        centers.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(centers, found.centers, "{name}");
    }
}

#[test]
fn octrees_are_made_of_any_lattice() {
    for kind in [LatticeKind::Cubic, LatticeKind::Fcc] {
        let mut mapper = mapper(kind);
        let [(_, binary), (_, full)] = octomaps(&mut mapper);
        assert_eq!((binary.binary, full.binary), (true, false));
        assert_eq!(binary.header.frame_id, "map");
        // A node of a full tree has five bytes, an inner node of a binary one two.
        assert!(binary.data.len() > 1000 && binary.data.len() < full.data.len());
        assert_eq!(mapper.counts().octomaps_refused, 0);
    }
}

#[test]
fn a_map_beyond_the_keys_of_an_octree_is_refused_and_counted() {
    let mut mapper = mapper(LatticeKind::Cubic);
    maps::insert(&mut mapper, &[[4096.3, 0.0, 0.0]]);
    for form in [OctreeForm::Binary, OctreeForm::Full] {
        let error = mapper.octomap(form).unwrap_err().to_string();
        assert!(error.contains("reaches 4096 m"), "{error}");
    }
    assert_eq!(mapper.counts().octomaps_refused, 2);
}

#[test]
fn damaged_files_and_messages_are_refused_or_read_but_never_more() {
    const DAMAGED: usize = 500;
    let folder = tempfile::tempdir().unwrap();
    let mut mapper = mapper(LatticeKind::Cubic);
    write_files(&mapper, folder.path());
    let mut random = Random(46);
    let mut damage = |good: &[u8]| {
        let mut bad = good.to_vec();
        let at = random.below(good.len());
        match random.below(3) {
            0 => bad.truncate(at),
            1 => bad[at] ^= 1 << random.below(8),
            _ => {
                bad.splice(at..at, [random.below(256) as u8; 3]);
            }
        }
        bad
    };
    let limits = PointFileOptions {
        max_points: 100_000,
        ..PointFileOptions::default()
    };
    let path = folder.path().join("bad");
    for name in ["file.bt", "file.ot"] {
        let good = fs::read(folder.path().join(name)).unwrap();
        let mut refused = 0;
        for _ in 0..DAMAGED {
            fs::write(&path, damage(&good)).unwrap();
            match read_points(&path, &limits) {
                Ok(file) => assert!(file.points_m.len() <= limits.max_points),
                Err(error) => {
                    refused += 1;
                    assert!(!error.to_string().is_empty());
                }
            }
        }
        assert!(refused > DAMAGED / 3, "{name}: {refused}");
    }
    for (_, map) in octomaps(&mut mapper) {
        let good = cdr::to_vec(&GetOctomapResponse { map }).unwrap();
        for _ in 0..DAMAGED {
            // What is read has no more than the bytes had.
            let bad = damage(&good);
            if let Ok(found) = cdr::from_slice::<GetOctomapResponse>(&bad) {
                assert!(found.map.data.len() <= bad.len());
            }
        }
    }
}
