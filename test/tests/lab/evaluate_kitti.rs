//! Labelled scans of KITTI against the truth of its INS.

use lattice_lab::evaluate::kitti::{
    KittiMethod, KittiTopics, Prepared, RIGHT, pairs_of, read_scans,
};
use lattice_test::data;
use nalgebra::Vector3;

/// Side of the cells to which the scans are thinned, metres.
const CELL_M: f64 = 0.3;

#[test]
fn scans_25_m_apart_are_registered_without_a_start_both_ways() {
    let Some(bag) = data::shared("kitti00/bag_mcap") else {
        return;
    };
    let scans = read_scans(&bag, &KittiTopics::default()).unwrap();
    assert_eq!(scans.len(), 3);
    assert!(
        scans
            .iter()
            .all(|scan| scan.cloud.labels.len() == scan.cloud.len())
    );
    // The sensor's place on the machine, where the track begins.
    let first = scans[0].map_from_sensor;
    assert!((first.translation.vector - Vector3::new(0.27, 0.0, 1.73)).norm() < 0.05);
    assert!((first.rotation.angle().to_degrees() - 0.5).abs() < 0.1);

    let two = [scans[0].clone(), scans[2].clone()];
    let prepared: Vec<Prepared> = (two.iter())
        .map(|scan| Prepared::new(scan, CELL_M).unwrap())
        .collect();
    let pairs = pairs_of(&two);
    assert_eq!(pairs.len(), 2);
    for pair in &pairs {
        assert!((25.0..26.0).contains(&pair.distance_m));
        let ours = KittiMethod::Ours { thinned: false };
        let row = pair.run(&ours, false, &prepared).unwrap();
        assert_eq!(row.verdict.as_deref(), Some("OK"), "{row:?}");
        assert!(
            row.translation_m <= RIGHT.m && row.rotation_deg <= RIGHT.deg,
            "{row:?}"
        );
        assert!(row.right);
        // What it found is not where it would have started.
        let start = pair.run(&KittiMethod::Start, false, &prepared).unwrap();
        assert!(start.translation_m > 25.0 && !start.right);
    }
}
