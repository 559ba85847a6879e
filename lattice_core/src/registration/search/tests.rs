//! The search in a flat of two rooms.

use super::*;
use crate::registration::testing::Flat;
use crate::registration::{PrepareOptions, SemanticCloud};

fn prepared(cloud: SemanticCloud) -> PreparedCloud {
    PreparedCloud::new(cloud, &PrepareOptions::default()).unwrap()
}

/// Every so manyth point.
fn every(cloud: &SemanticCloud, step: usize) -> SemanticCloud {
    SemanticCloud::unlabelled(cloud.points_m.iter().copied().step_by(step).collect())
}

#[test]
fn the_right_place_is_among_the_first() {
    let flat = Flat::new();
    let map = prepared(flat.map(1));
    let searched = SearchMap::of_surfaces(&map, 0.05).unwrap();
    let looks = [
        ([3.5, 3.8, 1.6], -2.2),
        ([1.0, 3.9, 1.6], -0.6),
        ([7.5, 3.0, 1.6], 2.2),
        ([6.5, 3.0, 1.6], -0.4),
    ];
    for (i, (eye, yaw)) in looks.into_iter().enumerate() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.5 * i as f64);
        let truth = Isometry3::from_parts(Translation3::new(2.0, -1.0, 0.7), turn);
        let headset_scan = flat.headset_scan(Point3::from(eye), yaw, &truth, 7);
        let source = prepared(every(&headset_scan.cloud, 8));
        for sensor_m in [None, headset_scan.sensor_m] {
            let found = search(
                &searched,
                &SearchSource::by_surface(&source, sensor_m),
                None,
                20,
            );
            let eye = headset_scan.sensor_m.unwrap();
            let rank = found.iter().position(|h| {
                let pose = h.target_from_source;
                nalgebra::distance(&(pose * eye), &(truth * eye)) < 0.2
                    && pose.rotation.angle_to(&turn) < 0.08
            });
            assert!(rank.is_some_and(|r| r < 3), "{rank:?}");
        }
    }
}
