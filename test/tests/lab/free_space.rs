//! Free space on a log with a person: the person goes from the map, the yard stays.

use lattice_bag::{BagReader, Storage};
use lattice_core::lattice::MortonKey;
use lattice_lab::datasets::{BobcatOptions, write_bobcat};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::{self, Pipeline, Slice, TopicWishes};
use lattice_nodes::voxel_marker_publisher::MarkerOptions;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;
use std::collections::BTreeSet;
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
    let no_markers = MarkerOptions {
        max_voxels: 0,
        ..MarkerOptions::default()
    };
    let mut pipeline = Pipeline::new(transformer, options, &no_markers).unwrap();
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
