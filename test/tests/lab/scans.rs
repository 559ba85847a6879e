//! Scans of simulated lasers against clouds of the same beams.

use std::path::Path;

use lattice_bag::{BagReader, Storage};
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_lab::datasets::{BobcatOptions, write_bobcat};
use lattice_msgs::RosMessage;
use lattice_msgs::sensor_msgs::LaserScan;
use lattice_nodes::enu_transformer::{TransformerCounts, TransformerOptions};
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::{self, Pipeline, Slice, TopicWishes};

/// Cells of a log's map, and what its transformer counted.
fn map(folder: &Path, scans: bool) -> (Vec<MortonKey>, TransformerCounts) {
    let out = folder.join(format!("scans_{scans}"));
    let options = BobcatOptions {
        seed: 4,
        duration_s: 6.0,
        begin_s: 0.0,
        person: false,
        scans,
        ins_offset: [0.0; 4],
        storage: Storage::Mcap,
        out: out.clone(),
        overwrite: false,
    };
    let summary = write_bobcat(&options, &mut |_| {}).unwrap();
    let bag = BagReader::open(&out).unwrap();
    let of_scans = bag
        .topics()
        .iter()
        .filter(|t| t.type_name == LaserScan::TYPE);
    assert_eq!(of_scans.count(), if scans { 3 } else { 0 });
    let plan = replay::plan(&bag, &TopicWishes::default()).unwrap();
    assert_eq!(plan.clouds(&bag), summary.clouds);
    let mut transformer = TransformerOptions::new(plan.source);
    transformer.viewpoints = true;
    let lattice = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
    let maps = [MapperOptions::new(lattice)];
    let mut pipeline = Pipeline::new(transformer, maps, None).unwrap();
    let report = replay::run(&bag, &plan, &Slice::WHOLE, &mut pipeline, "", &mut |_| {}).unwrap();
    assert_eq!(report.losses(), Vec::<String>::new());
    let cells = pipeline.mappers().next().unwrap().cells().sorted_keys();
    (cells, report.transformer.counts)
}

#[test]
fn scans_give_the_map_of_clouds_of_the_same_beams() {
    let folder = tempfile::tempdir().unwrap();
    let [(clouds, of_clouds), (scans, of_scans)] =
        [false, true].map(|scans| map(folder.path(), scans));
    assert!(clouds.len() > 2000, "{} cells", clouds.len());
    assert_eq!(clouds, scans);
    assert_eq!(of_clouds.points_out, of_scans.points_out);
    // 181 beams a scan, those without a return included.
    assert_eq!(of_scans.points_in, 181 * of_scans.clouds_in);
    assert_eq!(
        of_scans.points_in,
        of_scans.points_out + of_scans.points_not_finite
    );
}
