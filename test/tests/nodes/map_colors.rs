//! Colours on their way from the sensor through the map to those who follow it.

use std::sync::Arc;

use lattice_core::lattice::LatticeKind;
use lattice_core::voxels::ColorSum;
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::map_follower::MapFollower;
use lattice_nodes::voxel_marker_publisher::{ColorBy, MarkerOptions, MarkerStyle, VoxelMarkers};
use lattice_test::clouds::{SECOND_NS, cloud, colored_cloud, odometry};
use lattice_test::maps::{self, follow_update, follower};
use nalgebra::Isometry3;

/// A mapper of cubes of 1 m3 that keeps colours.
fn mapper() -> LatticeMapper {
    maps::mapper(MapperOptions {
        keep_color: true,
        ..maps::options(LatticeKind::Cubic, 1.0)
    })
}

/// Two cells: one of three points, one of a single point.
fn two_cells() -> PointCloud2 {
    let points = [
        ([0.1, 0.0, 0.0], [250, 0, 10]),
        ([f32::NAN, 0.0, 0.0], [0, 255, 0]),
        ([0.0, 0.1, 0.0], [251, 1, 10]),
        ([0.0, 0.0, 0.1], [252, 5, 10]),
        ([3.0, 0.0, 0.0], [7, 8, 9]),
    ];
    colored_cloud("map", 1, &points)
}

/// Number of coloured points and mean colour by cell, along x.
type Colors = Vec<Option<(u32, [u8; 3])>>;

fn colors_of(follower: &MapFollower) -> Colors {
    let map = follower.map().unwrap();
    let mut keys: Vec<_> = map.voxels().keys().collect();
    keys.sort_by_key(|key| map.center_m(**key).x as i64);
    let color = |key: &&_| map.color(**key).map(|color| (color.count, color.rgb));
    keys.iter().map(color).collect()
}

fn two_colors() -> Colors {
    vec![Some((3, [251, 2, 10])), Some((1, [7, 8, 9]))]
}

#[test]
fn keyframes_and_updates_have_the_mean_colours() {
    let mut mapper = mapper();
    let mut early = follower(&mut mapper);
    mapper.on_cloud(&two_cells()).unwrap();
    follow_update(&mut early, &mut mapper);
    let mut late = follower(&mut mapper);
    assert_eq!(colors_of(&early), two_colors());
    assert_eq!(colors_of(&late), two_colors());
    assert!(late.map().unwrap().has_colors());

    // A cloud without colours changes the count only.
    late.take_touched();
    mapper
        .on_cloud(&cloud("map", 2, &[[3.0, 0.0, 0.0]]))
        .unwrap();
    assert_eq!(mapper.counts().clouds_uncolored, 1);
    follow_update(&mut late, &mut mapper);
    assert_eq!(colors_of(&late), two_colors());
    assert_eq!(late.take_touched().0.len(), 1);
    assert_eq!(late.differences(), 0);

    // A follower that missed a colour alone notices it by the checksum.
    let green = colored_cloud("map", 3, &[([3.0, 0.0, 0.0], [7, 255, 9])]);
    mapper.on_cloud(&green).unwrap();
    let mut update = mapper.take_update();
    let last = update[0].keys.len() - 1;
    update[0].keys[last] ^= 1;
    late.on_update(&update[0]).unwrap();
    assert_eq!(late.differences(), 1);
}

#[test]
fn removed_cells_have_no_colours() {
    let mut mapper = mapper();
    mapper.on_cloud(&two_cells()).unwrap();
    let mut follower = follower(&mut mapper);
    mapper.reset(8);
    maps::follow_keyframe(&mut follower, &mut mapper);
    assert_eq!(colors_of(&follower), []);
    assert!(!follower.map().unwrap().has_colors());
}

#[test]
fn a_map_that_keeps_none_has_the_messages_that_it_had() {
    let mut plain = maps::mapper(maps::options(LatticeKind::Cubic, 1.0));
    let mut same = maps::mapper(maps::options(LatticeKind::Cubic, 1.0));
    plain.on_cloud(&two_cells()).unwrap();
    let points = [
        [0.1, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [0.0, 0.1, 0.0],
        [0.0, 0.0, 0.1],
        [3.0, 0.0, 0.0],
    ];
    same.on_cloud(&cloud("map", 1, &points)).unwrap();
    let (chunks, others) = (plain.keyframe(), same.keyframe());
    assert_eq!(chunks, others);
    assert_eq!(chunks[0].key_encoding, LatticeMap::KEY_ENCODING_MORTON21);
    assert_eq!(plain.counts().clouds_uncolored, 0);
    let names: Vec<_> = plain.centers().fields.into_iter().map(|f| f.name).collect();
    assert_eq!(names, ["x", "y", "z", "intensity"]);
}

#[test]
fn damaged_colours_are_refused() {
    let mut mapper = mapper();
    mapper.on_cloud(&two_cells()).unwrap();
    let good = mapper.keyframe();
    let refused = |change: &dyn Fn(&mut LatticeMap), part: &str| {
        let mut chunk = good[0].clone();
        change(&mut chunk);
        let error = MapFollower::new(1_000_000).on_map(&chunk).unwrap_err();
        assert!(error.to_string().contains(part), "{error}");
    };
    refused(
        &|m| assert!(m.keys.pop().is_some()),
        "colours has 5 entries",
    );
    refused(&|m| m.keys.push(0), "colours has 7 entries");
    refused(&|m| m.voxels = u32::MAX, "cut short");
    refused(&|m| m.voxels = 1, "voxels, expected");
    refused(&|m| m.key_encoding.push('x'), "is unknown");
    refused(&|m| m.keys.truncate(3), "cut short");
}

#[test]
fn coloured_chunks_are_small_enough() {
    let mut mapper = mapper();
    let points: Vec<_> = (0..40_000_u32)
        .map(|i| ([(i % 200) as f32, (i / 200) as f32, 0.0], [i as u8, 0, 255]))
        .collect();
    mapper.on_cloud(&colored_cloud("map", 1, &points)).unwrap();
    let chunks = mapper.keyframe();
    assert!(chunks.len() > 5);
    for chunk in &chunks {
        let bytes = lattice_msgs::cdr::to_vec(chunk).unwrap().len();
        assert!(bytes <= 60_000, "{bytes}");
    }
    assert_eq!(colors_of(&follower(&mut mapper)).len(), 40_000);
}

#[test]
fn centers_have_the_colour_as_pcl_packs_it() {
    let mut mapper = mapper();
    mapper.on_cloud(&two_cells()).unwrap();
    mapper
        .on_cloud(&cloud("map", 2, &[[6.0, 0.0, 0.0]]))
        .unwrap();
    let centers = mapper.centers();
    let names: Vec<_> = centers
        .fields
        .iter()
        .map(|f| (&*f.name, f.offset))
        .collect();
    assert_eq!(names[3..], [("intensity", 12), ("rgb", 16)]);
    let rows = centers.data.chunks_exact(centers.point_step as usize);
    let colors: Vec<_> = rows.map(|row| row[16..].to_vec()).collect();
    assert_eq!(colors, [[10, 2, 251, 0], [9, 8, 7, 0], [0; 4]]);
}

#[test]
fn a_map_file_keeps_colours_and_one_without_them_can_be_loaded() {
    let mut first = mapper();
    first.on_cloud(&two_cells()).unwrap();
    let mut other = mapper();
    other.load(first.contents(), 8).unwrap();
    let key = first.list().sorted()[0].0;
    let expected = ColorSum {
        count: 3,
        sum: [753, 6, 30],
    };
    assert_eq!(other.list().color(key), Some(expected));
    let mut plain = maps::mapper(maps::options(LatticeKind::Cubic, 1.0));
    plain.load(first.contents(), 8).unwrap();
    assert_eq!(plain.list().color(key), None);
    other.load(plain.contents(), 9).unwrap();
    assert_eq!(other.list().color(key), Some(ColorSum::default()));
}

#[test]
fn the_transformer_passes_colours_and_markers_show_them() {
    let mut transformer = EnuTransformer::new(TransformerOptions::new(InsSource::Odometry));
    let start_ns = 1_700_000_000 * SECOND_NS;
    for step in 0..10 {
        let stamp_ns = start_ns + step * SECOND_NS / 100;
        let pose = odometry(stamp_ns, &Isometry3::translation(10.0, 0.0, 0.0));
        transformer.on_ins("ins", InsMessage::Odometry(&pose), stamp_ns);
    }
    let points = [
        ([2.0, 0.0, 0.0], [200, 100, 50]),
        ([5.0, 0.0, 0.0], [1, 2, 3]),
    ];
    let message = colored_cloud("base_link", start_ns + SECOND_NS / 100, &points);
    let outputs = transformer.on_cloud("points", Arc::new(message), start_ns);
    let Some(EnuOutput::Points(out)) = outputs.last() else {
        panic!("{outputs:?}");
    };
    let mut mapper = mapper();
    mapper.on_cloud(out).unwrap();
    // A cell without a colour.
    mapper
        .on_cloud(&cloud("map", out.header.stamp.to_ns(), &[[18.0, 0.0, 0.0]]))
        .unwrap();
    let expected = vec![Some((1, [200, 100, 50])), Some((1, [1, 2, 3])), None];
    assert_eq!(colors_of(&follower(&mut mapper)), expected);

    for style in [MarkerStyle::Cells, MarkerStyle::Cubes, MarkerStyle::Points] {
        let mut markers = VoxelMarkers::new(MarkerOptions {
            style,
            color_by: ColorBy::Color,
            ..MarkerOptions::default()
        });
        for chunk in mapper.keyframe() {
            markers.on_map(&chunk).unwrap();
        }
        let arrays = markers.take_arrays(1 << 20);
        let drawn = arrays.iter().flat_map(|array| &array.markers);
        let drawn: Vec<_> = drawn.filter(|marker| !marker.points.is_empty()).collect();
        assert!(drawn.iter().all(|m| m.colors.len() == m.points.len()));
        let colors = drawn.iter().flat_map(|marker| &marker.colors);
        let mut bytes: Vec<_> = colors
            .map(|c| [c.r, c.g, c.b].map(|value| (255.0 * value).round() as u8))
            .collect();
        bytes.dedup();
        bytes.sort_unstable();
        assert_eq!(bytes, [[1, 2, 3], [115; 3], [200, 100, 50]], "{style:?}");
    }
}
