use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::loop_closure::{Anchor, Corrections};
use lattice_core::voxels::Region;
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::lattice::ClearBoxRequest;
use proptest::prelude::*;

use super::*;
use crate::convert::cloud::{Precision, message_from_points};
use crate::convert::geometry::header;
use crate::lattice_mapper::MapperOptions;

/// Side of the voxels' cube, m.
const SIDE_M: f64 = 0.5;

fn machine() -> LatticeMapper {
    let lattice = Lattice::new(LatticeKind::Fcc, SIDE_M.powi(3)).unwrap();
    LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap()
}

fn epoch() -> u64 {
    7
}

/// Points of a wall 2 m beside a place at `x_m`, in the frame of the odometry.
fn wall(stamp_ns: i64, x_m: f64) -> PointCloud2 {
    let point = |i: u32| {
        let along = f64::from(i % 20) * 0.13;
        let up = f64::from(i / 20) * 0.17;
        Vector3::new(x_m + along, 2.0 + 0.01 * along.sin(), up)
    };
    let points: Vec<_> = (0..200).map(point).collect();
    message_from_points(header("odom", stamp_ns), &points, Precision::Float32)
}

fn anchor(stamp_ns: i64, submap: u32, [x, y, turn]: [f64; 3]) -> Anchor {
    Anchor {
        stamp_ns,
        submap,
        map_from_odom: Isometry3::new(Vector3::new(x, y, 0.0), Vector3::z() * turn),
    }
}

/// Corrections with submap 0, and others that are joined.
fn corrections(anchors: Vec<Anchor>, joined: &[u32]) -> TFMessage {
    let placed = PlacedCorrections {
        corrections: Corrections::new(anchors),
        placed: joined.iter().copied().chain([0]).collect(),
    };
    placed.message("map", "odom")
}

/// The map of the clouds that are kept, with the corrections of now, from nothing.
fn from_nothing(drive: &CorrectedDrive) -> LatticeMapper {
    let mut machine = machine();
    for cloud in &drive.clouds {
        if let Some(place) = drive.place(cloud.stamp_ns) {
            let message = cloud.message(&drive.map_frame, &place);
            machine.on_cloud(&message).unwrap();
        }
    }
    machine
}

fn drive_of(machine: &LatticeMapper) -> CorrectedDrive {
    CorrectedDrive::new(machine, 1 << 24)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// After corrections at any times the map in the end is the one of the kept clouds with the last corrections, to the bit.
    #[test]
    fn a_corrected_map_is_the_one_made_with_corrected_poses(
        moves in prop::collection::vec((0..40_i64, prop::array::uniform3(-1.0..1.0_f64)), 1..12),
    ) {
        let mut machine = machine();
        let mut drive = drive_of(&machine);
        let mut anchors = vec![anchor(0, 0, [0.0; 3])];
        drive.on_corrections(&corrections(anchors.clone(), &[])).unwrap();
        let mut moves = moves.into_iter().peekable();
        for number in 0..40_i64 {
            while let Some((_, move_to)) = moves.next_if(|(at, _)| *at <= number) {
                // All places change, as after a loop, and a segment begins.
                for (i, one) in anchors.iter_mut().enumerate().skip(1) {
                    let part = i as f64 / 12.0;
                    *one = anchor(one.stamp_ns, 0, move_to.map(|v| part * v));
                }
                anchors.push(anchor(number * 1000, 0, move_to));
                drive.on_corrections(&corrections(anchors.clone(), &[])).unwrap();
            }
            drive.on_cloud(&mut machine, &wall(number * 1000, 0.4 * number as f64)).unwrap();
            if number % 3 == 0 {
                drive.step(&mut machine, epoch).unwrap();
            }
        }
        drive.finish(&mut machine, epoch).unwrap();
        let expected = from_nothing(&drive);
        prop_assert!(!expected.list().is_empty());
        prop_assert_eq!(machine.list().sorted(), expected.list().sorted());
        prop_assert_eq!(machine.counts().clouds_in, 40);
        let counts = machine.counts();
        let kept = counts.points_mapped + drive.counts().points_thinned;
        prop_assert_eq!(kept + counts.points_not_finite, 40 * 200);
    }
}

#[test]
fn the_clouds_of_a_submap_are_mapped_once_a_loop_joins_it() {
    let mut machine = machine();
    let mut drive = drive_of(&machine);
    let refused = drive.on_cloud(&mut machine, &wall(5, 0.0));
    assert!(matches!(refused, Err(CloudRefusal::NoCorrections)));
    let mut anchors = vec![anchor(0, 0, [0.0; 3])];
    drive
        .on_corrections(&corrections(anchors.clone(), &[]))
        .unwrap();
    drive.on_cloud(&mut machine, &wall(10, 0.0)).unwrap();
    let first = machine.list().len();
    anchors.extend([anchor(99, 0, [0.0; 3]), anchor(100, 1, [0.0; 3])]);
    drive
        .on_corrections(&corrections(anchors.clone(), &[]))
        .unwrap();
    drive.on_cloud(&mut machine, &wall(110, 5.0)).unwrap();
    assert!(!drive.step(&mut machine, epoch).unwrap());
    assert_eq!(
        (machine.list().len(), drive.counts().clouds_unplaced),
        (first, 1)
    );
    assert!(drive.problem().unwrap().contains("no loop joins"));
    anchors[2] = anchor(100, 1, [0.0, 3.0, 0.0]);
    drive.on_corrections(&corrections(anchors, &[1])).unwrap();
    assert!(drive.step(&mut machine, epoch).unwrap());
    assert!(machine.list().len() > first);
    assert_eq!(machine.state().0, 7);
    let counts = drive.counts();
    assert_eq!((counts.clouds_unplaced, counts.maps_corrected), (0, 1));
    assert_eq!(
        (counts.clouds_no_corrections, machine.counts().clouds_in),
        (1, 3)
    );
    assert_eq!(drive.problem(), None);
}

#[test]
fn another_drive_is_refused_until_the_map_is_another() {
    let mut machine = machine();
    let mut drive = drive_of(&machine);
    let begun = |stamp_ns: i64| corrections(vec![anchor(stamp_ns, 0, [0.0; 3])], &[]);
    drive.on_corrections(&begun(100)).unwrap();
    drive.on_cloud(&mut machine, &wall(110, 0.0)).unwrap();
    let voxels = machine.list().sorted();
    drive.on_corrections(&begun(5000)).unwrap();
    let refused = drive.on_cloud(&mut machine, &wall(5010, 9.0));
    assert!(matches!(refused, Err(CloudRefusal::OtherDrive)));
    assert!(!drive.finish(&mut machine, epoch).unwrap());
    assert_eq!(machine.list().sorted(), voxels);
    assert_eq!(drive.counts().clouds_other_drive, 1);
    assert!(drive.problem().unwrap().contains("~/reset"));
    machine.reset(3);
    drive.restart(&machine);
    drive.on_cloud(&mut machine, &wall(5010, 9.0)).unwrap();
    assert!(!machine.list().is_empty() && drive.problem().is_none());
}

#[test]
fn cleared_boxes_and_loaded_voxels_outlast_a_correction() {
    let mut before = machine();
    let far = wall(1, 100.0);
    before
        .on_cloud(&PointCloud2 {
            header: header("map", 1),
            ..far
        })
        .unwrap();
    let mut machine = machine();
    machine.load(before.contents(), 2).unwrap();
    let mut drive = drive_of(&machine);
    let anchors = |y: f64| vec![anchor(0, 0, [0.0; 3]), anchor(50, 0, [0.0, y, 0.0])];
    drive
        .on_corrections(&corrections(anchors(0.0), &[]))
        .unwrap();
    for number in 0..10 {
        let cloud = wall(number * 10, number as f64);
        drive.on_cloud(&mut machine, &cloud).unwrap();
    }
    let corner = |x: f64, r: f64| Point { x, y: r, z: r };
    let request = ClearBoxRequest {
        min: corner(2.0, -50.0),
        max: corner(4.0, 50.0),
    };
    assert!(machine.clear_box(&request).success);
    let region = Region::cuboid(
        Vector3::new(2.0, -50.0, -50.0),
        Vector3::new(4.0, 50.0, 50.0),
    );
    drive.remove(&machine, &region.unwrap());
    drive
        .on_corrections(&corrections(anchors(3.0), &[]))
        .unwrap();
    assert!(drive.step(&mut machine, epoch).unwrap());
    let centers: Vec<_> = (machine.list().sorted().iter())
        .map(|(key, _)| machine.list().center_m(*key))
        .collect();
    assert!(centers.iter().any(|c| c.y > 4.0), "the wall has moved");
    assert!(
        centers.iter().any(|c| c.x > 99.0),
        "the file's voxels are there"
    );
    // A corrected point may lie in the box; none of those that were in it does.
    let stays = |c: &&Vector3<f64>| (2.3..3.7).contains(&c.x) && c.y < 2.4;
    assert_eq!(centers.iter().filter(stays).count(), 0);
}

#[test]
fn beyond_its_memory_the_map_grows_and_is_not_corrected() {
    let mut machine = machine();
    let mut drive = CorrectedDrive::new(&machine, 8000);
    let anchors = |y: f64| vec![anchor(0, 0, [0.0; 3]), anchor(10, 0, [0.0, y, 0.0])];
    drive
        .on_corrections(&corrections(anchors(0.0), &[]))
        .unwrap();
    for number in 0..10 {
        let cloud = wall(number * 10, 3.0 * number as f64);
        drive.on_cloud(&mut machine, &cloud).unwrap();
    }
    let counts = drive.counts().clone();
    assert!(counts.clouds_not_kept > 0 && drive.is_full);
    let voxels = machine.list().sorted();
    drive
        .on_corrections(&corrections(anchors(3.0), &[]))
        .unwrap();
    assert!(!drive.finish(&mut machine, epoch).unwrap());
    assert_eq!(machine.list().sorted(), voxels);
    assert!(drive.problem().unwrap().contains("max_kept_bytes"));
    // An empty map has room again.
    machine.reset(8);
    drive.restart(&machine);
    drive.on_cloud(&mut machine, &wall(200, 0.0)).unwrap();
    assert_eq!((drive.clouds.len(), drive.problem()), (1, None));
}

#[test]
fn malformed_messages_are_counted() {
    let mut machine = machine();
    let mut drive = drive_of(&machine);
    assert!(drive.on_corrections(&TFMessage::default()).is_err());
    assert_eq!(drive.counts().corrections_refused, 1);
    let begun = corrections(vec![anchor(0, 0, [0.0; 3])], &[]);
    drive.on_corrections(&begun).unwrap();
    let mut short = wall(5, 0.0);
    short.data.truncate(100);
    assert!(drive.on_cloud(&mut machine, &short).is_err());
    let mut elsewhere = wall(5, 0.0);
    elsewhere.header.frame_id = "wheels".into();
    assert!(drive.on_cloud(&mut machine, &elsewhere).is_err());
    let counts = machine.counts();
    assert_eq!((counts.clouds_malformed, counts.clouds_wrong_frame), (1, 1));
    assert_eq!(counts.clouds_in, 2);
    let points = vec![
        Vector3::new(f64::NAN, 0.0, 0.0),
        Vector3::new(1.0, 1.0, 1.0),
    ];
    let holes = message_from_points(header("odom", 6), &points, Precision::Float64);
    drive.on_cloud(&mut machine, &holes).unwrap();
    let counts = machine.counts();
    assert_eq!((counts.points_in, counts.points_not_finite), (2, 1));
    assert_eq!(machine.list().len(), 1);
}
