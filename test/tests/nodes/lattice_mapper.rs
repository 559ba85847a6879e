//! The mapper: chunks, what it refuses, and its datum.

use lattice_core::lattice::LatticeKind;
use lattice_msgs::cdr;
use lattice_nodes::convert::cloud::{Precision, message_from_points};
use lattice_nodes::lattice_mapper::{MapPayload, MapperOptions};
use lattice_test::clouds::{cloud, header};
use lattice_test::maps::{self, insert};
use nalgebra::Vector3;

use super::map_follower::{assert_same, mapper, scatter};

#[test]
fn every_chunk_is_small_enough_not_to_be_fragmented() {
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &scatter(1, 60_000, [0.0; 3], 200.0));
    let updates = mapper.take_update();
    let keyframe = mapper.keyframe();
    assert!(updates.len() > 5 && keyframe.len() > 5);
    let updates = updates.iter().map(|m| cdr::to_vec(m).unwrap().len());
    let chunks = keyframe.iter().map(|m| cdr::to_vec(m).unwrap().len());
    for bytes in updates.chain(chunks) {
        assert!(bytes <= 60_000, "{bytes}");
    }
    let chunks = keyframe.len() as u32;
    assert!(keyframe.iter().all(|chunk| chunk.chunks == chunks));
}

#[test]
fn one_stray_point_does_not_move_the_others() {
    let points = scatter(1, 5000, [0.0; 3], 50.0);
    let mut clean = mapper(LatticeKind::Mcc);
    insert(&mut clean, &points);
    for stray in [1e5, 1e7, 1e30_f32] {
        let mut with_stray = mapper(LatticeKind::Mcc);
        let strayed = [&[[stray, 0.0, 0.0]], &points[..]].concat();
        insert(&mut with_stray, &strayed);
        let near = |list: &lattice_core::voxels::VoxelList| {
            let mut voxels = list.sorted();
            voxels.retain(|(key, _)| list.center_m(*key).norm() < 1000.0);
            voxels
        };
        assert_eq!(near(with_stray.list()), near(clean.list()), "{stray}");
    }
}

#[test]
fn refused_clouds_leave_the_map_as_it_is() {
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &scatter(1, 1000, [0.0; 3], 20.0));
    let before = mapper.list().sorted();
    assert!(mapper.on_cloud(&cloud("laser", 1, &[[1.0; 3]])).is_err());
    let mut lie = cloud("map", 1, &[[1.0; 3]]);
    lie.width = 1 << 30;
    assert!(mapper.on_cloud(&lie).is_err());
    let outside = [[f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [1e30, 0.0, 0.0]];
    insert(&mut mapper, &outside);
    assert_eq!(mapper.list().sorted(), before);
    let counts = mapper.counts();
    assert_eq!((counts.clouds_wrong_frame, counts.clouds_malformed), (1, 1));
    let points = (counts.points_not_finite, counts.points_out_of_range);
    assert_eq!(points, (2, 1));
    assert_eq!((counts.points_in, counts.points_mapped), (1003, 1000));
}

#[test]
fn a_full_list_refuses_new_voxels_and_says_so() {
    let mut mapper = maps::mapper(MapperOptions {
        max_voxels: 100,
        ..maps::options(LatticeKind::Cubic, 0.125)
    });
    insert(&mut mapper, &scatter(1, 5000, [0.0; 3], 50.0));
    assert_eq!(mapper.list().len(), 100);
    assert!(mapper.counts().points_list_full > 4000);
}

#[test]
fn a_datum_far_away_loses_no_digit() {
    let options = || maps::options(LatticeKind::Fcc, 0.001);
    let far = Vector3::new(5_000_000.0, -3_000_000.0, 2_000_000.0);
    let mut mapper = maps::mapper(MapperOptions {
        datum_near_m: far,
        ..options()
    });
    let points = (0..100).map(|i| far + Vector3::x() * f64::from(i));
    let points: Vec<_> = points.collect();
    let message = message_from_points(header("map", 1), &points, Precision::Float64);
    mapper.on_cloud(&message).unwrap();
    assert_eq!(mapper.list().len(), 100);
    assert!(mapper.distortion().max_distance_m <= 0.0795);
    assert_same(&maps::follower(&mut mapper), &mapper);
    // The same cloud on a map about the origin is out of the reach of its keys.
    let mut near = maps::mapper(MapperOptions {
        datum_is_given: true,
        ..options()
    });
    near.on_cloud(&message).unwrap();
    assert_eq!(near.counts().points_out_of_range, 100);
}

#[test]
fn limits_can_be_changed_while_it_maps() {
    for payload in [MapPayload::Centroid, MapPayload::Occupancy] {
        let options = |max_voxels, max_cloud_points| MapperOptions {
            payload,
            max_voxels,
            max_cloud_points,
            ..maps::options(LatticeKind::Cubic, 0.125)
        };
        let mut mapper = maps::mapper(options(100, 10_000));
        insert(&mut mapper, &scatter(1, 5000, [0.0; 3], 50.0));
        assert_eq!(mapper.cells().len(), 100);
        mapper.set_options(options(300, 10_000));
        insert(&mut mapper, &scatter(2, 5000, [0.0; 3], 50.0));
        assert_eq!(mapper.cells().len(), 300);
        mapper.set_options(options(200, 10));
        assert!(mapper.on_cloud(&cloud("map", 1, &[[1.0; 3]; 11])).is_err());
        insert(&mut mapper, &[[200.0; 3]]);
        assert_eq!(mapper.cells().len(), 300, "no more than there are");
    }
}
