//! The mapper: chunks, what it refuses, and its datum.

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_msgs::cdr;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::map_follower::MapFollower;
use lattice_test::clouds::cloud;

use super::map_follower::{MAX_VOXELS, assert_same, follow_keyframe, insert, mapper, scatter};

#[test]
fn every_chunk_is_small_enough_not_to_be_fragmented() {
    let mut mapper = mapper(LatticeKind::Fcc);
    insert(&mut mapper, &scatter(1, 60_000, [0.0; 3], 200.0));
    let updates = mapper.take_update();
    let keyframe = mapper.keyframe();
    assert!(updates.len() > 5 && keyframe.len() > 5);
    for bytes in updates.iter().map(|m| cdr::to_vec(m).unwrap().len()) {
        assert!(bytes <= 60_000, "{bytes}");
    }
    for bytes in keyframe.iter().map(|m| cdr::to_vec(m).unwrap().len()) {
        assert!(bytes <= 60_000, "{bytes}");
    }
    assert!(
        keyframe
            .iter()
            .all(|chunk| chunk.chunks == keyframe.len() as u32)
    );
}

#[test]
fn one_stray_point_does_not_move_the_others() {
    let points = scatter(1, 5000, [0.0; 3], 50.0);
    let mut clean = mapper(LatticeKind::Mcc);
    insert(&mut clean, &points);
    for stray in [1e5, 1e7, 1e30_f32] {
        let mut with_stray = mapper(LatticeKind::Mcc);
        insert(
            &mut with_stray,
            &[&[[stray, 0.0, 0.0]], &points[..]].concat(),
        );
        let near = |list: &lattice_core::voxels::VoxelList| {
            let voxels = list.sorted().into_iter();
            voxels
                .filter(|(key, _)| list.center_m(*key).norm() < 1000.0)
                .collect::<Vec<_>>()
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
    insert(
        &mut mapper,
        &[[f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [1e30, 0.0, 0.0]],
    );
    assert_eq!(mapper.list().sorted(), before);
    let counts = mapper.counts();
    assert_eq!((counts.clouds_wrong_frame, counts.clouds_malformed), (1, 1));
    assert_eq!(
        (counts.points_not_finite, counts.points_out_of_range),
        (2, 1)
    );
}

#[test]
fn a_full_list_refuses_new_voxels_and_says_so() {
    let lattice = Lattice::new(LatticeKind::Cubic, 0.125).unwrap();
    let options = MapperOptions {
        max_voxels: 100,
        ..MapperOptions::new(lattice)
    };
    let mut mapper = LatticeMapper::new(options, 1).unwrap();
    insert(&mut mapper, &scatter(1, 5000, [0.0; 3], 50.0));
    assert_eq!(mapper.list().len(), 100);
    assert!(mapper.counts().points_list_full > 4000);
}

#[test]
fn a_datum_far_away_loses_no_digit() {
    let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
    let far = nalgebra::Vector3::new(5_000_000.0, -3_000_000.0, 2_000_000.0);
    let options = MapperOptions {
        datum_near_m: far,
        ..MapperOptions::new(lattice)
    };
    let mut mapper = LatticeMapper::new(options, 1).unwrap();
    let header = lattice_test::clouds::header("map", 1);
    let points: Vec<_> = (0..100)
        .map(|i| far + nalgebra::Vector3::x() * f64::from(i))
        .collect();
    let message = lattice_nodes::convert::cloud::message_from_points(
        header,
        &points,
        lattice_nodes::convert::cloud::Precision::Float64,
    );
    mapper.on_cloud(&message).unwrap();
    assert_eq!(mapper.list().len(), 100);
    assert!(mapper.distortion().max_distance_m <= 0.0795);
    let mut follower = MapFollower::new(MAX_VOXELS);
    follow_keyframe(&mut follower, &mapper.keyframe());
    assert_same(&follower, &mapper);
    // The same cloud on a map about the origin is out of the reach of its keys.
    let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
    let mut near = LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap();
    near.on_cloud(&message).unwrap();
    assert_eq!(near.counts().points_out_of_range, 100);
}
