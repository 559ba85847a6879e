//! The marker publisher's logic: cell shapes, exposed faces, chunks, ADD and DELETE.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelStore;
use lattice_msgs::cdr;
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use lattice_nodes::hurry::Hurry;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::voxel_marker_publisher::{MarkerOptions, MarkerStyle, VoxelMarkers};
use lattice_test::clouds::cloud;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A mapper, its markers, and a viewer that obeys the markers.
struct Bench {
    mapper: LatticeMapper,
    markers: VoxelMarkers,
    shown: BTreeMap<(String, i32), Marker>,
}

impl Bench {
    fn new(kind: LatticeKind, options: MarkerOptions) -> Self {
        Self::of(Lattice::new(kind, 0.125).unwrap(), options)
    }

    fn of(lattice: Lattice, options: MarkerOptions) -> Self {
        let mut mapper = LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap();
        let mut markers = VoxelMarkers::new(options);
        for chunk in mapper.keyframe() {
            markers.on_map(&chunk).unwrap();
        }
        Self {
            mapper,
            markers,
            shown: BTreeMap::new(),
        }
    }

    fn insert(&mut self, points: &[[f32; 3]]) -> Vec<MarkerArray> {
        self.mapper.on_cloud(&cloud("map", 1, points)).unwrap();
        for chunk in self.mapper.take_update() {
            self.markers.on_update(&chunk).unwrap();
        }
        self.draw()
    }

    fn draw(&mut self) -> Vec<MarkerArray> {
        let mut all = Vec::new();
        while self.markers.is_dirty() {
            all.extend(self.markers.take_arrays(1 << 20));
        }
        for marker in all.iter().flat_map(|array| &array.markers) {
            let identity = (marker.ns.clone(), marker.id);
            match marker.action {
                Marker::ADD => {
                    assert_ne!(marker.scale.x, 0.0);
                    let q = &marker.pose.orientation;
                    let square = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
                    assert!((square - 1.0).abs() < 1e-12);
                    let (points, colors) = (marker.points.len(), marker.colors.len());
                    assert!(points > 0, "an empty ADD is an error in Foxglove");
                    assert!(colors == 0 || colors == points);
                    self.shown.insert(identity, marker.clone());
                }
                Marker::DELETE => {
                    self.shown.remove(&identity);
                }
                Marker::DELETEALL => self.shown.clear(),
                other => panic!("action {other}"),
            }
        }
        all
    }

    fn shown_points(&self) -> usize {
        self.shown.values().map(|marker| marker.points.len()).sum()
    }

    /// Triangles of all shown markers, in the map frame.
    fn triangles(&self) -> Vec<[Vector3<f64>; 3]> {
        let mut triangles = Vec::new();
        for marker in self.shown.values() {
            assert_eq!(marker.type_, Marker::TRIANGLE_LIST);
            let p = &marker.pose.position;
            let origin = Vector3::new(p.x, p.y, p.z);
            let point = |p: &Point| origin + Vector3::new(p.x, p.y, p.z);
            let corners = marker.points.chunks_exact(3);
            triangles.extend(corners.map(|t| [point(&t[0]), point(&t[1]), point(&t[2])]));
        }
        triangles
    }
}

/// Volume inside a closed surface of outward triangles.
fn volume(triangles: &[[Vector3<f64>; 3]]) -> f64 {
    let volume = |t: &[Vector3<f64>; 3]| t[0].dot(&t[1].cross(&t[2])) / 6.0;
    triangles.iter().map(volume).sum()
}

fn line(n: usize, step: f32) -> Vec<[f32; 3]> {
    (0..n).map(|i| [i as f32 * step, 0.1, 0.2]).collect()
}

/// Cells of a plane.
fn plane(count: i32) -> Vec<[f32; 3]> {
    let cell = |i: i32| [i % 400, i / 400, 0].map(|v| v as f32 + 0.25);
    (0..count).map(cell).collect()
}

#[test]
fn a_publisher_that_has_to_end_draws_nothing_and_names_the_rest() {
    let hurry = Hurry::default();
    let mut bench = Bench::new(LatticeKind::Cubic, MarkerOptions::default());
    bench.markers = bench.markers.hurried_by(&hurry);
    let cells = plane(150_000);
    bench.mapper.on_cloud(&cloud("map", 1, &cells)).unwrap();
    bench.mapper.take_update();
    for chunk in bench.mapper.keyframe() {
        bench.markers.on_map(&chunk).unwrap();
    }
    let waiting = bench.markers.unplaced();
    assert!(waiting > 0 && bench.markers.is_dirty());
    hurry.request();
    assert!(bench.markers.take_arrays(1 << 20).is_empty());
    assert_eq!(bench.markers.unplaced(), waiting);
}

/// Changes that came while nothing was drawn are drawn with the rest of the map.
#[test]
fn a_publisher_that_rested_draws_the_whole_map() {
    let options = MarkerOptions::default();
    let [mut rested, mut always] = [0; 2].map(|_| Bench::new(LatticeKind::Fcc, options.clone()));
    for (step, count) in [(0, 100), (1, 5000), (2, 7000)] {
        if step == 1 {
            rested.markers.rest();
        }
        let drawn = rested.insert(&plane(count));
        assert_eq!(drawn.is_empty(), step > 0);
        always.insert(&plane(count));
    }
    rested.markers.wake();
    rested.draw();
    let points = always.shown_points();
    assert!(points > 0);
    assert_eq!(rested.shown_points(), points);
    // Both go on alike.
    for bench in [&mut rested, &mut always] {
        bench.insert(&plane(9000));
        assert!(bench.shown_points() > points);
    }
    assert_eq!(rested.shown_points(), always.shown_points());
}

#[test]
fn one_voxel_is_its_whole_cell() {
    // 6 squares; 6 squares and 8 hexagons; 12 rhombs; 14 faces like BCC; hexagonal prisms.
    for (kind, triangles) in LatticeKind::ALL.into_iter().zip([12, 44, 24, 44, 20, 20]) {
        let mut bench = Bench::new(kind, MarkerOptions::default());
        bench.insert(&[[3.0, 4.0, 5.0]]);
        assert_eq!(bench.triangles().len(), triangles, "{kind}");
        assert!((volume(&bench.triangles()) - 0.125).abs() < 1e-12, "{kind}");
    }
}

/// A custom lattice and named ones, turned.
fn turned() -> Vec<Lattice> {
    let turn = UnitQuaternion::from_euler_angles(0.5, -0.3, 1.1);
    let skew = Matrix3::new(0.5, 0.1, 0.0, 0.0, 0.4, 0.1, 0.2, 0.0, 0.6);
    let mut lattices = vec![Lattice::from_basis(skew).unwrap()];
    lattices.extend(LatticeKind::ALL.map(|kind| Lattice::new(kind, 0.125).unwrap()));
    lattices.into_iter().map(|l| l.oriented(turn)).collect()
}

#[test]
fn markers_lie_as_the_lattice_of_the_mapper_lies() {
    for lattice in turned() {
        let mut bench = Bench::of(lattice.clone(), MarkerOptions::default());
        bench.insert(&[[3.0, 4.0, 5.0]]);
        let list = bench.mapper.list();
        let center = list.center_m(list.sorted()[0].0);
        let triangles = bench.triangles();
        assert!((volume(&triangles) - lattice.cell_volume_m3()).abs() < 1e-12);
        for vertex in &lattice.cell().vertices {
            let corners = triangles.iter().flatten();
            let nearest = corners.map(|corner| (corner - center - vertex).norm());
            assert!(nearest.fold(f64::MAX, f64::min) < 1e-12, "{lattice:?}");
        }
    }
}

#[test]
fn cubes_are_turned_and_stand_on_the_centres() {
    for lattice in turned() {
        let options = MarkerOptions {
            style: MarkerStyle::Cubes,
            ..MarkerOptions::default()
        };
        let mut bench = Bench::of(lattice.clone(), options);
        bench.insert(&line(20, 0.3));
        let mut found = 0;
        for marker in bench.shown.values() {
            assert_eq!(marker.type_, Marker::CUBE_LIST);
            let (p, q) = (&marker.pose.position, &marker.pose.orientation);
            let turn = UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z));
            assert_eq!(turn, lattice.orientation());
            for point in &marker.points {
                let offset = turn * Vector3::new(point.x, point.y, point.z);
                let at = Vector3::new(p.x, p.y, p.z) + offset;
                let key = bench.mapper.list().key_of(&at).unwrap();
                assert!((bench.mapper.list().center_m(key) - at).norm() < 1e-12);
                assert!(bench.mapper.list().get(key).is_some());
                found += 1;
            }
        }
        assert_eq!(found, bench.mapper.list().len());
    }
}

#[test]
fn only_exposed_faces_are_drawn_across_blocks_too() {
    for kind in LatticeKind::ALL {
        for block_bits in [1, 3, 6] {
            let options = MarkerOptions {
                block_bits,
                ..MarkerOptions::default()
            };
            let mut bench = Bench::new(kind, options);
            bench.insert(&line(40, 0.2));
            let voxels = bench.mapper.list().len();
            let triangles = bench.triangles();
            // Closed, so its volume is that of the voxels, and no face is there from both sides.
            let off_m3 = volume(&triangles) - 0.125 * voxels as f64;
            assert!(off_m3.abs() < 1e-9, "{kind}");
            let round = |v: f64| (v * 1e6).round() as i64;
            let centers = triangles.iter().map(|t| (t[0] + t[1] + t[2]).map(round));
            let different: BTreeSet<[i64; 3]> = centers.map(Into::into).collect();
            assert_eq!(different.len(), triangles.len(), "{kind}");
        }
    }
}

#[test]
fn growing_by_parts_ends_as_all_at_once() {
    let points = line(200, 0.13);
    let mut parts = Bench::new(LatticeKind::Fcc, MarkerOptions::default());
    for part in points.chunks(7) {
        parts.insert(part);
    }
    let mut whole = Bench::new(LatticeKind::Fcc, MarkerOptions::default());
    whole.insert(&points);
    assert_eq!(parts.shown_points(), whole.shown_points());
    let difference = volume(&parts.triangles()) - volume(&whole.triangles());
    assert!(difference.abs() < 1e-9);
}

#[test]
fn only_what_changed_is_published_again() {
    let mut bench = Bench::new(LatticeKind::Fcc, MarkerOptions::default());
    bench.insert(&line(400, 0.2));
    let markers = bench.shown.len();
    assert!(markers > 10);
    let again = bench.insert(&line(400, 0.2));
    assert!(again.is_empty(), "more points in voxels change no face");
    let far = bench.insert(&[[40.0, 0.1, 6.0]]);
    let touched: usize = far.iter().map(|array| array.markers.len()).sum();
    assert!(touched <= 2, "{touched} of {markers} markers for one voxel");
}

#[test]
fn arrays_are_small_enough_not_to_be_fragmented() {
    for style in [MarkerStyle::Cells, MarkerStyle::Cubes, MarkerStyle::Points] {
        let options = MarkerOptions {
            style,
            block_bits: 6,
            ..MarkerOptions::default()
        };
        let mut bench = Bench::new(LatticeKind::Bcc, options);
        let point = |i: i32| [(i % 100) as f32 * 0.3, (i / 100) as f32 * 0.3, 0.0];
        let points: Vec<_> = (0..10_000).map(point).collect();
        for array in bench.insert(&points) {
            let bytes = cdr::to_vec(&array).unwrap().len();
            assert!(bytes <= 60_000, "{style:?}: {bytes}");
        }
        assert!(bench.shown_points() > 0);
    }
}

#[test]
fn cubes_are_deleted_before_they_are_replaced() {
    let options = MarkerOptions {
        style: MarkerStyle::Cubes,
        ..MarkerOptions::default()
    };
    let mut bench = Bench::new(LatticeKind::Mcc, options);
    bench.insert(&line(3, 1.0));
    let again = bench.insert(&line(4, 1.0));
    let actions = again[0].markers.iter().map(|marker| marker.action);
    assert!(actions.take(2).eq([Marker::DELETE, Marker::ADD]));
    assert_eq!(bench.shown_points(), 4);
    let side = bench.shown.values().next().unwrap().scale.x;
    assert!((side - 0.5).abs() < 1e-12);
}

#[test]
fn a_reset_map_takes_all_markers_away() {
    let mut bench = Bench::new(LatticeKind::Fcc, MarkerOptions::default());
    bench.insert(&line(100, 0.5));
    bench.mapper.reset(2);
    for chunk in bench.mapper.keyframe() {
        bench.markers.on_map(&chunk).unwrap();
    }
    bench.draw();
    assert!(bench.shown.is_empty());
    bench.insert(&line(1, 1.0));
    assert_eq!(bench.triangles().len(), 24);
}

#[test]
fn a_viewer_that_joins_late_gets_everything_and_the_others_lose_nothing() {
    let mut bench = Bench::new(LatticeKind::Fcc, MarkerOptions::default());
    bench.insert(&line(100, 0.5));
    let before = std::mem::take(&mut bench.shown);
    bench.markers.redraw();
    let arrays = bench.draw();
    let points =
        |shown: &BTreeMap<_, Marker>| shown.values().map(|m| m.points.len()).sum::<usize>();
    assert_eq!(points(&bench.shown), points(&before));
    let mut markers = arrays.iter().flat_map(|array| &array.markers);
    assert!(markers.all(|marker| marker.action == Marker::ADD));
}

#[test]
fn a_map_too_large_for_cells_is_drawn_as_points() {
    let options = MarkerOptions {
        max_marker_voxels: 50,
        ..MarkerOptions::default()
    };
    let mut bench = Bench::new(LatticeKind::Fcc, options);
    bench.insert(&line(20, 1.0));
    assert_eq!(bench.markers.style(), MarkerStyle::Cells);
    bench.insert(&line(100, 1.0));
    assert_eq!(bench.markers.style(), MarkerStyle::Points);
    assert_eq!(bench.shown_points(), 100);
}

#[test]
fn other_options_draw_all_of_it_anew() {
    let mut bench = Bench::new(LatticeKind::Fcc, MarkerOptions::default());
    bench.insert(&line(100, 1.0));
    let cells = bench.shown_points();
    for (style, block_bits, points) in [
        (MarkerStyle::Points, 3, 100),
        (MarkerStyle::Points, 5, 100),
        (MarkerStyle::Cells, 2, cells),
    ] {
        bench.markers.set_options(MarkerOptions {
            style,
            block_bits,
            ..MarkerOptions::default()
        });
        bench.draw();
        assert_eq!(bench.shown_points(), points, "{style:?} {block_bits}");
    }
    bench.insert(&line(120, 1.0));
    bench.draw();
    assert!(
        bench.shown_points() > cells,
        "changes are followed as before"
    );
}
