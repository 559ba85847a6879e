//! Labels on their way from the sensor through the map to those who follow it.

use std::sync::Arc;

use lattice_bag::BagReader;
use lattice_core::lattice::LatticeKind;
use lattice_core::registration::{SemanticCloud, UNLABELED};
use lattice_core::voxels::LabelCount;
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_nodes::convert::semantic::LabelOptions;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::map_follower::MapFollower;
use lattice_nodes::replay::{self, Pipeline, Slice, TopicWishes};
use lattice_test::clouds::{SECOND_NS, cloud, field, labelled_cloud, odometry};
use lattice_test::data::shared;
use lattice_test::maps::{self, follow_update, follower};
use nalgebra::Isometry3;

/// A mapper of cubes of 1 m3 that keeps labels.
fn mapper() -> LatticeMapper {
    maps::mapper(MapperOptions {
        labels: Some(LabelOptions::default()),
        ..maps::options(LatticeKind::Cubic, 1.0)
    })
}

/// The same with the three cells.
fn mapped() -> LatticeMapper {
    let mut mapper = mapper();
    mapper.on_cloud(&three_cells()).unwrap();
    mapper
}

/// Three cells: one of several labels, one without, one of a single label.
fn three_cells() -> PointCloud2 {
    let points = [
        ([0.1, 0.0, 0.0], 5),
        ([0.0, 0.1, 0.0], 8),
        ([f32::NAN, 0.0, 0.0], 5),
        ([0.0, 0.0, 0.1], 8),
        ([0.0, 0.0, 0.2], UNLABELED),
        ([0.0, 0.2, 0.0], UNLABELED),
        ([0.2, 0.0, 0.0], UNLABELED),
        ([3.0, 0.0, 0.0], UNLABELED),
        ([6.0, 0.0, 0.0], 300),
    ];
    labelled_cloud("map", 1, &points)
}

/// Labels of a message of the map in the order of the keys.
const EXPECTED: [(u16, u32); 3] = [(8, 2), (UNLABELED, 0), (300, 1)];

fn labels_of(follower: &MapFollower) -> Vec<(u16, u32)> {
    let map = follower.map().unwrap();
    let mut voxels: Vec<_> = map.voxels().iter().collect();
    voxels.sort_by_key(|(key, _)| map.center_m(**key).x as i64);
    let voxels = voxels.into_iter();
    voxels.map(|(_, v)| (v.label, v.label_count)).collect()
}

#[test]
fn keyframes_and_updates_tell_the_most_frequent_label() {
    let mut mapper = mapper();
    let mut early = follower(&mut mapper);
    mapper.on_cloud(&three_cells()).unwrap();
    follow_update(&mut early, &mut mapper);
    let mut late = follower(&mut mapper);
    assert_eq!(labels_of(&early), EXPECTED);
    assert_eq!(labels_of(&late), EXPECTED);

    // A label that changes without another count is news.
    late.take_touched();
    let five = [([0.1, 0.0, 0.0], 5), ([0.1, 0.0, 0.0], 5)];
    mapper.on_cloud(&labelled_cloud("map", 2, &five)).unwrap();
    follow_update(&mut late, &mut mapper);
    assert_eq!(labels_of(&late)[0], (5, 3));
    assert_eq!(late.take_touched().0.len(), 1);
}

#[test]
fn a_followed_map_is_a_cloud_with_shares_of_labels() {
    let mut mapper = mapped();
    let labelled = follower(&mut mapper);
    let map = labelled.map().unwrap();
    let direct = SemanticCloud::from_voxels(mapper.list());
    let ours = map.semantic_cloud();
    assert_eq!(ours.len(), 3);
    for i in 0..3 {
        assert!((ours.points_m[i] - direct.points_m[i]).norm() <= 2.0 * map.offset_unit_m);
        assert_eq!(ours.label(i).top(), direct.label(i).top());
    }
    let found: Vec<_> = ours.label(0).iter().collect();
    let share = "the share of the points of the cell";
    assert_eq!(found, [(8, 2.0 / 6.0)], "{share}");

    let mut plain = maps::mapper(maps::options(LatticeKind::Cubic, 1.0));
    plain.on_cloud(&three_cells()).unwrap();
    let chunks = plain.keyframe();
    let unlabelled = |c: &LatticeMap| c.labels.is_empty() && c.label_counts.is_empty();
    assert!(chunks.iter().all(unlabelled));
    let plain = follower(&mut plain);
    assert!(plain.map().unwrap().semantic_cloud().labels.is_empty());
}

#[test]
fn columns_of_different_length_are_refused() {
    let good = mapped().keyframe();
    let refused = |change: &dyn Fn(&mut LatticeMap), part: &str| {
        let mut chunk = good[0].clone();
        change(&mut chunk);
        let error = MapFollower::new(1_000_000).on_map(&chunk).unwrap_err();
        assert!(error.to_string().contains(part), "{error}");
    };
    refused(
        &|m| m.labels.truncate(2),
        "labels has 2 entries for 3 voxels",
    );
    refused(&|m| m.labels.clear(), "labels has 0");
    refused(&|m| m.label_counts.push(1), "label_counts has 4");
}

#[test]
fn labelled_chunks_are_small_enough_too() {
    let mut mapper = mapper();
    let points: Vec<_> = (0..40_000_u32)
        .map(|i| ([(i % 200) as f32, (i / 200) as f32, 0.0], (i % 50) as u16))
        .collect();
    mapper.on_cloud(&labelled_cloud("map", 1, &points)).unwrap();
    let chunks = mapper.keyframe();
    assert!(chunks.len() > 5);
    for chunk in chunks {
        let bytes = lattice_msgs::cdr::to_vec(&chunk).unwrap().len();
        assert!(bytes <= 60_000, "{bytes}");
    }
}

#[test]
fn centers_have_the_label() {
    let centers = mapped().centers();
    let names: Vec<_> = centers.fields.iter().map(|f| &*f.name).collect();
    assert_eq!(names, ["x", "y", "z", "intensity", "label"]);
    let rows = centers.data.chunks_exact(centers.point_step as usize);
    let labels: Vec<u16> = rows
        .map(|row| u16::from_le_bytes([row[16], row[17]]))
        .collect();
    assert_eq!(labels, EXPECTED.map(|(label, _)| label));
}

#[test]
fn a_map_file_keeps_labels_and_one_without_them_can_be_loaded() {
    let mapper = mapped();
    let mut other = self::mapper();
    other.load(mapper.contents(), 8).unwrap();
    let key = mapper.list().sorted()[0].0;
    let count = |label, count| LabelCount { label, count };
    let expected = [count(5, 1), count(8, 2), count(UNLABELED, 3)];
    assert_eq!(other.list().labels(key), expected);

    let mut plain = maps::mapper(maps::options(LatticeKind::Cubic, 1.0));
    plain.load(mapper.contents(), 8).unwrap();
    assert!(!plain.list().payload().labels);
    other.load(plain.contents(), 9).unwrap();
    assert!(other.list().payload().labels && other.list().labels(key).is_empty());
    let unlabelled = cloud("map", 3, &[[0.0; 3]]);
    other.on_cloud(&unlabelled).unwrap();
    assert_eq!(other.counts().clouds_unlabelled, 1);
    assert_eq!(other.list().len(), 3);
}

#[test]
fn the_transformer_passes_labels_of_the_points_it_keeps() {
    let mut options = TransformerOptions::new(InsSource::Odometry);
    options.min_range_m = 1.0;
    let mut transformer = EnuTransformer::new(options);
    let start_ns = 1_700_000_000 * SECOND_NS;
    for step in 0..10 {
        let stamp_ns = start_ns + step * SECOND_NS / 100;
        let pose = odometry(stamp_ns, &Isometry3::translation(10.0, 0.0, 0.0));
        transformer.on_ins("ins", InsMessage::Odometry(&pose), stamp_ns);
    }
    let points = [
        ([0.5, 0.0, 0.0], 1),
        ([2.0, 0.0, 0.0], 2),
        ([f32::NAN, 0.0, 0.0], 3),
        ([3.0, 0.0, 0.0], 4),
    ];
    let mut message = labelled_cloud("base_link", start_ns + SECOND_NS / 100, &points);
    message.fields.push(field("other", 12, 2));
    let outputs = transformer.on_cloud("points", Arc::new(message), start_ns);
    let Some(EnuOutput::Points(out)) = outputs.last() else {
        panic!("{outputs:?}");
    };
    let names: Vec<_> = out.fields.iter().map(|f| (&*f.name, f.offset)).collect();
    assert_eq!(names, [("x", 0), ("y", 4), ("z", 8), ("label", 12)]);
    let expected = [([12.0, 0.0, 0.0], 2), ([13.0, 0.0, 0.0], 4)];
    assert_eq!(out.data, labelled_cloud("map", 0, &expected).data);
}

#[test]
fn replaying_labelled_scans_gives_a_labelled_map() {
    let Some(bag) = shared("kitti00/bag_mcap") else {
        return;
    };
    let reader = BagReader::open(&bag).unwrap();
    let wishes = TopicWishes {
        points: vec!["/velodyne/semantic_points".into()],
        ..TopicWishes::default()
    };
    let plan = replay::plan(&reader, &wishes).unwrap();
    let mut map = maps::options(LatticeKind::Fcc, 0.125);
    let mut labels = LabelOptions::default();
    labels.ignored.insert(0);
    map.labels = Some(labels);
    let transformer = TransformerOptions::new(plan.source);
    let mut pipeline = Pipeline::new(transformer, [map], None).unwrap();
    replay::run(
        &reader,
        &plan,
        &Slice::WHOLE,
        &mut pipeline,
        "kitti",
        &mut |_| {},
    )
    .unwrap();
    let mapper = pipeline.mappers().next().unwrap();
    assert_eq!(mapper.counts().clouds_unlabelled, 0);
    let cloud = SemanticCloud::from_voxels(mapper.list());
    let labelled = (0..cloud.len()).filter(|&i| cloud.label(i).top().is_some());
    let share = labelled.count() as f64 / cloud.len() as f64;
    let voxels = cloud.len();
    assert!(voxels > 10_000 && share > 0.9, "{voxels} voxels, {share}");
    // The classes of the network are 1 to 18; what lies on the ground by its label does so.
    let road = (0..cloud.len()).filter(|&i| cloud.label(i).top() == Some(9));
    let heights: Vec<f64> = road.map(|i| cloud.points_m[i].z).collect();
    let mean_m = heights.iter().sum::<f64>() / heights.len() as f64;
    let all_m = cloud.points_m.iter().map(|p| p.z).sum::<f64>() / cloud.len() as f64;
    let low = mean_m < all_m - 0.3;
    assert!(heights.len() > 500 && low, "{mean_m} m, all {all_m} m");
}
