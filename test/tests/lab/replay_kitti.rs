//! Direct replay of real scans against an exhaustive nearest-point search made elsewhere.

use lattice_bag::BagReader;
use lattice_core::geodesy::Geodetic;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::write_map;
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::enu_transformer::ins::InsSource;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::RunReport;
use lattice_nodes::replay::{self, Pipeline, Slice, TopicWishes};
use lattice_test::data::shared;
use std::path::Path;

/// Of each lattice of the paper: voxels, MSE per dimension, mean distance, RMS, largest distance;
/// cells of 0.125 m^3, f64.
const EXPECTED: [[f64; 5]; 5] = [
    [26353.0, 0.020679, 0.23923, 0.24907, 0.4295],
    [27515.0, 0.019616, 0.23456, 0.24259, 0.3514],
    [28175.0, 0.019670, 0.23464, 0.24292, 0.3947],
    [27178.0, 0.019646, 0.23446, 0.24277, 0.3631],
    [25311.0, 0.020907, 0.24097, 0.25044, 0.3974],
];

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.unwrap().install(work)
}

/// The report and the maps of a log, on two threads.
fn replayed(bag: &Path) -> (RunReport, Pipeline) {
    let reader = BagReader::open(bag).unwrap();
    let plan = replay::plan(&reader, &TopicWishes::default()).unwrap();
    let mut options = TransformerOptions::new(plan.source);
    options.ins.origin = Some(Geodetic::from_degrees(49.0, 8.4, 116.0).unwrap());
    let maps =
        LatticeKind::PAPER.map(|kind| MapperOptions::new(Lattice::new(kind, 0.125).unwrap()));
    let mut pipeline = Pipeline::new(options, maps, None).unwrap();
    let run = || {
        replay::run(
            &reader,
            &plan,
            &Slice::WHOLE,
            &mut pipeline,
            "kitti",
            &mut |_| {},
        )
        .unwrap()
    };
    (on_threads(2, run), pipeline)
}

#[test]
fn all_lattices_agree_with_an_exhaustive_search() {
    let Some(bag) = shared("kitti00/bag_mcap") else {
        return;
    };
    let report = replayed(&bag).0;
    assert_eq!(report.transformer.counts.clouds_in, 8);
    assert_eq!(report.losses(), Vec::<String>::new());
    let kinds = report.lattices.iter().map(|branch| &*branch.map.lattice);
    assert!(kinds.eq(LatticeKind::PAPER.map(LatticeKind::name)));
    for (branch, [voxels, figures @ ..]) in report.lattices.iter().zip(EXPECTED) {
        let (map, kind) = (&branch.map, &branch.map.lattice);
        assert_eq!(map.points, 994_498);
        let found = map.voxels;
        assert!(
            (found as f64 / voxels - 1.0).abs() < 5e-4,
            "{kind}: {found}"
        );
        let ours = [
            map.mse_per_dimension_m2,
            map.mean_distance_m,
            map.rms_m,
            map.max_distance_m,
        ];
        for (ours, expected) in ours.into_iter().zip(figures) {
            let off = (ours / expected - 1.0).abs();
            assert!(off < 2e-4, "{kind}: {ours}, expected {expected}");
        }
    }
}

#[test]
fn the_sqlite3_log_is_the_first_three_scans() {
    let (Some(mcap), Some(sqlite3)) = (shared("kitti00/bag_mcap"), shared("kitti00/bag_sqlite3"))
    else {
        return;
    };
    let (_, pipeline) = replayed(&sqlite3);
    // The same scans from the other container, on one thread.
    let reader = BagReader::open(&mcap).unwrap();
    let plan = replay::plan(&reader, &TopicWishes::default()).unwrap();
    let maps =
        LatticeKind::PAPER.map(|kind| MapperOptions::new(Lattice::new(kind, 0.125).unwrap()));
    let options = TransformerOptions::new(plan.source);
    let mut first = Pipeline::new(options, maps, None).unwrap();
    let mut clouds = 0;
    for message in reader.messages(&Default::default()).unwrap() {
        let message = message.unwrap();
        let Some(role) = plan.roles.get(&message.topic) else {
            continue;
        };
        if role.is_cloud() {
            clouds += 1;
            if clouds > 3 {
                continue;
            }
        }
        on_threads(1, || first.on_message("topic", *role, &message));
    }
    on_threads(1, || first.finish());
    for (one, two) in pipeline.mappers().zip(first.mappers()) {
        let [one, two] = [one, two].map(|mapper| {
            let mut file = Vec::new();
            write_map(mapper.list(), &mut file).unwrap();
            file
        });
        assert!(one == two, "the map depends on container or threads");
    }
}

#[test]
fn odometry_and_fix_with_imu_agree() {
    let Some(bag) = shared("kitti00/bag_mcap") else {
        return;
    };
    let reader = BagReader::open(&bag).unwrap();
    let mut tracks = Vec::new();
    for source in [InsSource::Odometry, InsSource::NavsatfixImu] {
        let wishes = TopicWishes {
            source: Some(source),
            ..TopicWishes::default()
        };
        let plan = replay::plan(&reader, &wishes).unwrap();
        let mut options = TransformerOptions::new(source);
        options.ins.origin = Some(Geodetic::from_degrees(49.0, 8.4, 116.0).unwrap());
        let maps: [MapperOptions; 0] = [];
        let mut pipeline = Pipeline::new(options, maps, None).unwrap();
        let mut track = Vec::new();
        for message in reader.messages(&Default::default()).unwrap() {
            let message = message.unwrap();
            if let Some(role @ replay::Role::Ins(_)) = plan.roles.get(&message.topic) {
                pipeline.on_message("topic", *role, &message);
                track.extend(pipeline.newest_pose());
            }
        }
        track.dedup_by_key(|pose| pose.stamp_ns);
        tracks.push(track);
    }
    assert_eq!(tracks[0].len(), tracks[1].len());
    assert!(tracks[0].len() > 300);
    for (odometry, fix) in tracks[0].iter().zip(&tracks[1]) {
        assert_eq!(odometry.stamp_ns, fix.stamp_ns);
        let (a, b) = (&odometry.map_from_base, &fix.map_from_base);
        let apart_m = (a.translation.vector - b.translation.vector).norm();
        assert!(apart_m < 1e-3, "{apart_m} m apart at {}", odometry.stamp_ns);
        assert!(a.rotation.angle_to(&b.rotation) < 2e-4);
    }
}
