//! Free space on logs with persons and cars: they go from the map, all that stands stays.

use lattice_bag::{BagReader, Storage};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::raycast::{ClearOptions, FreeSpaceMap, FreeSpaceOptions, RayBundle, RayClearer};
use lattice_core::voxels::{VoxelList, VoxelStore};
use lattice_lab::datasets::{BobcatOptions, write_bobcat};
use lattice_lab::simulate::drive::Drive;
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::{self, Pipeline, Slice, TopicWishes};
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::data::shared;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The person is gone after half of it.
const DURATION_S: f64 = 30.0;

/// Parameters of docs/free_space.md.
const CLEAR: &[&str] = &[
    "free_space:=clear",
    "rays.sweep_s:=1.0",
    "rays.keep_ratio:=0.25",
    "rays.spare_touching:=false",
    "rays.misses:=4",
];
const EVIDENCE: &[&str] = &[
    "free_space:=evidence",
    "rays.sweep_s:=2.0",
    "rays.keep_ratio:=0.2",
    "rays.spare_touching:=false",
    "evidence.threshold:=0.3",
];

/// A log with or without the person; all noise is the same.
fn log(folder: &Path, person: bool) -> PathBuf {
    let out = folder.join(format!("person_{person}"));
    let options = BobcatOptions {
        seed: 1,
        duration_s: DURATION_S,
        begin_s: 0.0,
        person,
        scans: false,
        ins_offset: [0.0; 4],
        storage: Storage::Mcap,
        out: out.clone(),
        overwrite: false,
    };
    write_bobcat(&options, &mut |_| {}).unwrap();
    out
}

/// Parameters as in `params/bobcat.yaml`, with others after them.
fn params(node: &str, more: &[&str]) -> Params {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../params/bobcat.yaml");
    let file = file.display().to_string();
    let mut arguments = vec!["--ros-args", "--params-file", &file];
    arguments.extend(more.iter().flat_map(|more| ["-p", more]));
    let arguments = arguments.into_iter().map(str::to_owned);
    Params::load(&RosArgs::parse(arguments).unwrap(), node).unwrap()
}

/// The occupied cells of one map for each set of parameters.
fn maps(bag: &Path, variants: &[&[&str]]) -> Vec<BTreeSet<MortonKey>> {
    let bag = BagReader::open(bag).unwrap();
    let plan = replay::plan(&bag, &TopicWishes::default()).unwrap();
    let transformer = params("/enu_transformer", &["viewpoints:=true"]);
    let mut transformer = TransformerOptions::from_params(&transformer).unwrap();
    transformer.ins.source = plan.source;
    let options =
        |more: &&[&str]| MapperOptions::from_params(&params("/lattice_mapper", more)).unwrap();
    let options = variants.iter().map(options);
    let mut pipeline = Pipeline::new(transformer, options, None).unwrap();
    let report = replay::run(
        &bag,
        &plan,
        &Slice::WHOLE,
        &mut pipeline,
        "bobcat",
        &mut |_| {},
    )
    .unwrap();
    assert_eq!(report.losses(), Vec::<String>::new());
    let cells = pipeline
        .mappers()
        .map(|mapper| mapper.cells().sorted_keys());
    cells.map(|keys| keys.into_iter().collect()).collect()
}

#[test]
fn a_person_goes_from_the_map_and_the_yard_stays() {
    let folder = tempfile::tempdir().unwrap();
    let yard = maps(&log(folder.path(), false), &[&[]]).remove(0);
    let maps = maps(&log(folder.path(), true), &[&[], CLEAR, EVIDENCE]);
    let (all, cleared) = maps.split_first().unwrap();
    let person: BTreeSet<_> = all.difference(&yard).copied().collect();
    let fixed: BTreeSet<_> = all.intersection(&yard).copied().collect();
    assert!(person.len() > 30 && fixed.len() > 5000);
    for (cells, variant) in cleared.iter().zip([CLEAR, EVIDENCE]) {
        let left = person.intersection(cells).count() as f64 / person.len() as f64;
        let lost = fixed.difference(cells).count() as f64 / fixed.len() as f64;
        assert!(
            left <= 0.05 && lost <= 0.005,
            "{variant:?}: {:.1} % of the person's cells are left, {:.2} % of the yard's are lost",
            100.0 * left,
            100.0 * lost
        );
    }
}

/// Points of one scan, by the position of the sensor, in the map frame, metres.
type Scan = Vec<(Vector3<f64>, Vec<Vector3<f64>>)>;

/// The first 15 s of a drive, with a position of the sensor every 10 ms.
fn driven(drive: &Drive) -> Vec<Scan> {
    const STEP_NS: i64 = 10_000_000;
    let scan = |number| {
        let scan = drive.scan(number);
        let mut bundles: BTreeMap<i64, Vec<Vector3<f64>>> = BTreeMap::new();
        for (point_m, time_ns) in scan.points_m.iter().zip(&scan.times_ns) {
            let pose = drive.pose(*time_ns);
            let point_m = pose.rotation * point_m + pose.translation.vector;
            bundles.entry(time_ns / STEP_NS).or_default().push(point_m);
        }
        let origin = |step: i64| drive.pose(step * STEP_NS + STEP_NS / 2).translation.vector;
        bundles
            .into_iter()
            .map(|(step, points)| (origin(step), points))
            .collect()
    };
    drive.scans().take(150).map(scan).collect()
}

fn cloud(points_m: &[Vector3<f64>]) -> Cloud {
    Cloud::from_points(0, Vector3::zeros(), points_m)
}

/// Rule by which the voxels along the rays of a scan are removed.
#[derive(Clone, Copy)]
enum Rule {
    Clear(ClearOptions),
    Evidence(FreeSpaceOptions),
}

enum Clearer {
    Rays(Box<RayClearer>),
    Evidence(Box<FreeSpaceMap>),
}

/// Voxels of all scans, and those that are left by a rule.
fn cleared(scans: &[Scan], cell_volume_m3: f64, rule: Rule) -> [VoxelList; 2] {
    let lattice = Lattice::new(LatticeKind::Fcc, cell_volume_m3).unwrap();
    let [mut all, mut left] =
        [0; 2].map(|_| VoxelList::new(lattice.clone(), Vector3::zeros(), usize::MAX).unwrap());
    let mut clearer = match rule {
        Rule::Clear(options) => Clearer::Rays(Box::new(RayClearer::new(&lattice, options))),
        Rule::Evidence(options) => {
            let map = FreeSpaceMap::new(lattice, Vector3::zeros(), options);
            Clearer::Evidence(Box::new(map.unwrap()))
        }
    };
    for scan in scans {
        let clouds: Vec<(Vector3<f64>, Cloud)> = scan
            .iter()
            .map(|(origin, points)| (*origin, cloud(points)))
            .collect();
        for (_, cloud) in &clouds {
            all.insert(cloud);
            left.insert(cloud);
        }
        let bundles: Vec<RayBundle> = (clouds.iter())
            .map(|(origin_m, ends)| RayBundle {
                origin_m: *origin_m,
                ends,
            })
            .collect();
        match &mut clearer {
            Clearer::Rays(clearer) => clearer.clear(&mut left, &bundles),
            Clearer::Evidence(map) => map.clear(&mut left, &bundles),
        };
    }
    [all, left]
}

/// Number of scans that have points in each cell.
fn scans_of_cells(scans: &[Scan], store: &dyn VoxelStore) -> BTreeMap<MortonKey, usize> {
    let mut counts = BTreeMap::new();
    for scan in scans {
        let points = scan.iter().flat_map(|(_, points)| points);
        let cells: BTreeSet<MortonKey> = points.filter_map(|p| store.key_of(p)).collect();
        for cell in cells {
            *counts.entry(cell).or_default() += 1;
        }
    }
    counts
}

const CROSSED: &str = "all that is crossed";

/// Rules and their names: the defaults of both methods, and rays that clear whatever they cross.
fn rules() -> [(&'static str, Rule); 3] {
    let evidence = FreeSpaceOptions {
        free_level: None,
        ..FreeSpaceOptions::default()
    };
    let crossing = ClearOptions {
        misses: 1,
        spare_touching: false,
        ..ClearOptions::default()
    };
    [
        ("clear", Rule::Clear(ClearOptions::default())),
        ("evidence", Rule::Evidence(evidence)),
        (CROSSED, Rule::Clear(crossing)),
    ]
}

fn percent(part: usize, all: usize) -> f64 {
    100.0 * part as f64 / all.max(1) as f64
}

/// Streets with passing cars and persons, against the same scans without them.
#[test]
fn passers_go_from_the_map_of_a_town_and_the_town_stays() {
    for (seed, cell_volume_m3) in [(1, 0.125), (2, 0.125), (1, 0.008)] {
        let [passers, still] = Drive::passers(seed).map(|drive| driven(&drive));
        for (name, rule) in rules() {
            // About the half everywhere.
            if name == CROSSED && (seed, cell_volume_m3) != (1, 0.125) {
                continue;
            }
            let [all, left] = cleared(&passers, cell_volume_m3, rule);
            let fixed = scans_of_cells(&still, &all);
            let seen_twice: Vec<_> = fixed.iter().filter(|(_, scans)| **scans > 1).collect();
            let lost = seen_twice
                .iter()
                .filter(|(key, _)| !left.contains(**key))
                .count();
            // Not those who are there at the end.
            let end = scans_of_cells(&passers[passers.len() - 1..], &all);
            let passed: Vec<MortonKey> = (all.sorted_keys().into_iter())
                .filter(|key| !fixed.contains_key(key) && !end.contains_key(key))
                .collect();
            let removed = passed.iter().filter(|key| !left.contains(**key)).count();
            let lost = percent(lost, seen_twice.len());
            let removed = percent(removed, passed.len());
            println!(
                "town {seed}, {cell_volume_m3} m^3, {name}: {lost:.2} % of {} lost, {removed:.1} % of {} removed",
                seen_twice.len(),
                passed.len()
            );
            assert!(seen_twice.len() > 20_000 && passed.len() > 1000);
            assert!(name == CROSSED || (lost < 2.0 && removed > 80.0));
        }
    }
}

/// Real scans of a street, which lose next to nothing by the default parameters.
#[test]
fn a_street_stays_in_the_map_of_kitti() {
    let Some(bag) = shared("kitti00/bag_mcap") else {
        return;
    };
    for volume in ["cell_volume_m3:=0.125", "cell_volume_m3:=0.008"] {
        let clear = [volume, "free_space:=clear"];
        let evidence = [volume, "free_space:=evidence"];
        let crossed = [&evidence[..], &["rays.spare_touching:=false"]].concat();
        let maps = maps(&bag, &[&[volume], &clear, &evidence, &crossed]);
        let (all, cleared) = maps.split_first().unwrap();
        let lost: Vec<f64> = cleared
            .iter()
            .map(|left| percent(all.len() - left.len(), all.len()))
            .collect();
        println!("kitti, {volume}: of {} lost {lost:.2?} %", all.len());
        assert!(all.len() > 20_000 && lost[0] < 1.0 && lost[1] < 0.5 && lost[2] > 5.0);
    }
}
