//! Free space on a log with a person: the person goes from the map, the yard stays.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use lattice_bag::{BagReader, Storage};
use lattice_core::lattice::MortonKey;
use lattice_lab::datasets::{BobcatOptions, write_bobcat};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::{self, Pipeline, TopicWishes};
use lattice_nodes::voxel_marker_publisher::MarkerOptions;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;

const DURATION_S: f64 = 30.0;

/// A log with or without the person; all noise is the same.
fn log(folder: &Path, person: bool) -> PathBuf {
    let out = folder.join(format!("person_{person}"));
    let options = BobcatOptions {
        seed: 1,
        duration_s: DURATION_S,
        person,
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
    let mut pipeline = Pipeline::new(
        transformer,
        options,
        &MarkerOptions {
            max_voxels: 0,
            ..MarkerOptions::default()
        },
    )
    .unwrap();
    let report = replay::run(&bag, &plan, &mut pipeline, "bobcat", &mut |_| {}).unwrap();
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
    let mut variants: Vec<Vec<String>> = vec![vec![]];
    for sweep in ["0.0", "2.0", "4.0"] {
        for range in ["0.0", "15.0"] {
            let with = |method: &str, last: String| {
                vec![
                    format!("free_space:={method}"),
                    format!("rays.sweep_s:={sweep}"),
                    format!("rays.max_range_m:={range}"),
                    last,
                ]
            };
            for misses in ["1", "2"] {
                variants.push(with("clear", format!("rays.misses:={misses}")));
            }
            if sweep != "4.0" {
                for threshold in ["0.5", "0.2"] {
                    variants.push(with("evidence", format!("evidence.threshold:={threshold}")));
                }
            }
        }
    }
    let refs: Vec<Vec<&str>> = variants
        .iter()
        .map(|v| v.iter().map(String::as_str).collect())
        .collect();
    let refs: Vec<&[&str]> = refs.iter().map(|v| v.as_slice()).collect();
    let maps = maps(&log(folder.path(), true), &refs);
    let all = &maps[0];
    let person: BTreeSet<_> = all.difference(&yard).copied().collect();
    let fixed: BTreeSet<_> = all.intersection(&yard).copied().collect();
    println!("{} person, {} fixed", person.len(), fixed.len());
    for (variant, cells) in variants.iter().zip(&maps) {
        println!(
            "{variant:?}: person left {} ({:.2} %), fixed lost {} ({:.2} %)",
            person.intersection(cells).count(),
            100.0 * person.intersection(cells).count() as f64 / person.len() as f64,
            fixed.difference(cells).count(),
            100.0 * fixed.difference(cells).count() as f64 / fixed.len() as f64,
        );
    }
}
