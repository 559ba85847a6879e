//! Clearance of points, lines, boxes and swept paths.

use lattice_core::lattice::{LatticeKind, MortonKey};
use lattice_core::query::{Clearance, ConvexShape, OrientedBox, Query, QueryError, Segment};
use lattice_core::voxels::VoxelList;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::polyhedra::Body;
use super::worlds::{any_offset, any_world, cells, ground};

fn any_pose(half_side_m: f64) -> impl Strategy<Value = Isometry3<f64>> {
    let turn = prop_oneof![Just(Vector3::zeros()), any_offset(3.0)];
    (any_offset(half_side_m), turn).prop_map(|(at, turn)| Isometry3::new(at, turn))
}

fn any_half_extents() -> impl Strategy<Value = Vector3<f64>> {
    let side = prop_oneof![1 => Just(0.0), 5 => 0.01..1.0, 1 => 1.0..20.0];
    prop::array::uniform3(side).prop_map(Vector3::from)
}

fn cell_body(voxels: &VoxelList, center: &Vector3<f64>) -> Body {
    let cell = voxels.lattice().cell();
    let triangles = cell.faces.iter().flat_map(|face| cell.triangles(face));
    Body::solid(triangles.map(|t| t.map(|p| p + center)).collect())
}

fn box_body(half: &Vector3<f64>, pose: &Isometry3<f64>) -> Body {
    let corner =
        |s: [f64; 3]| (pose * nalgebra::Point3::from(Vector3::from(s).component_mul(half))).coords;
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let at = |u: f64, v: f64| {
                let mut s = [0.0; 3];
                s[axis] = side;
                s[(axis + 1) % 3] = side * u;
                s[(axis + 2) % 3] = v;
                corner(s)
            };
            let square = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
            triangles.push([square[0], square[1], square[2]]);
            triangles.push([square[0], square[2], square[3]]);
        }
    }
    Body::solid(triangles)
}

/// Distance to every occupied cell.
fn distances(voxels: &VoxelList, body: &Body) -> Vec<(MortonKey, f64)> {
    let distance = |(key, center)| (key, body.distance(&cell_body(voxels, &center)));
    cells(voxels).into_iter().map(distance).collect()
}

/// What was found is the least of all distances, belongs to its cell, and obeys the bound.
fn check(
    all: &[(MortonKey, f64)],
    found: Option<Clearance>,
    max_m: f64,
    tolerance_m: f64,
) -> Result<(), TestCaseError> {
    let least = all.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
    match found {
        None => prop_assert!(
            all.is_empty() || least > max_m - tolerance_m,
            "{least} missed below {max_m}"
        ),
        Some(found) => {
            prop_assert!(
                (found.distance_m - least).abs() <= tolerance_m,
                "{found:?} {least}"
            );
            prop_assert!(found.distance_m <= max_m);
            let own = all.iter().find(|(key, _)| *key == found.key).unwrap().1;
            prop_assert!(
                (own - least).abs() <= tolerance_m,
                "{found:?} {own} {least}"
            );
        }
    }
    Ok(())
}

fn any_max() -> impl Strategy<Value = f64> {
    prop_oneof![Just(f64::INFINITY), Just(0.0), 0.0..3.0]
}

/// The cell of a point has distance 0 and its neighbours the distance of their polyhedra.
fn tolerance_m(offset: &Vector3<f64>) -> f64 {
    1e-9 + 1e-13 * offset.norm()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn points_and_lines_have_the_distance_of_brute_force(
        world in any_world(60),
        a in any_offset(4.0),
        b in prop_oneof![any_offset(4.0), any_offset(60.0)],
        max_m in any_max(),
    ) {
        let voxels = world.voxels();
        let query = Query::new(&voxels);
        let (p, q) = (world.datum_m + a, world.datum_m + b);
        let [a, b] = [p, q].map(|x| x - voxels.datum_m());
        let line = Segment { from_m: p, to_m: q };
        let found = query.clearance(&line, max_m).unwrap();
        let all = distances(&voxels, &Body::line(a, b));
        check(&all, found, max_m, tolerance_m(&b))?;
        prop_assert_eq!(query.is_free(&line, 0.3).unwrap(),
            query.clearance(&line, 0.3).unwrap().is_none());

        let found = query.clearance(&p, max_m).unwrap();
        let all = distances(&voxels, &Body::line(a, a));
        check(&all, found, max_m, tolerance_m(&a))?;
        let exact = query.clearance(&p, f64::INFINITY).unwrap();
        let bounds = query.clearance_bounds(&p).unwrap();
        prop_assert_eq!(exact.is_some(), bounds.is_some());
        if let (Some(exact), Some((low, high))) = (exact, bounds) {
            prop_assert!(low <= exact.distance_m + 1e-9 && exact.distance_m <= high + 1e-9);
        }
        if let Some(key) = query.occupied(&p) {
            prop_assert_eq!(exact, Some(Clearance { distance_m: 0.0, key }));
        }
    }

    #[test]
    fn boxes_have_the_distance_of_brute_force(
        world in any_world(30),
        pose in any_pose(4.0),
        half in any_half_extents(),
        max_m in any_max(),
    ) {
        let voxels = world.voxels();
        let shift = Translation3::from(world.datum_m);
        let shape = OrientedBox { pose: shift * pose, half_extents_m: half };
        let found = Query::new(&voxels).clearance(&shape, max_m).unwrap();
        let local = Translation3::from(-voxels.datum_m()) * shape.pose;
        let all = distances(&voxels, &box_body(&half.map(|h| h.max(1e-7)), &local));
        // Flat boxes are given a thickness for the brute force.
        check(&all, found, max_m, 3e-7)?;
    }

    #[test]
    fn swept_boxes_are_never_said_to_be_clearer_than_they_are(
        world in any_world(12),
        poses in prop::collection::vec(any_pose(2.0), 1..4),
        half in any_half_extents(),
    ) {
        let voxels = world.voxels();
        let shift = Translation3::from(world.datum_m);
        let poses: Vec<_> = poses.iter().map(|pose| shift * pose).collect();
        let query = Query::new(&voxels);
        let found = query.swept_box_clearance(&half, &poses, f64::INFINITY).unwrap();
        let mut least = f64::INFINITY;
        let mut reached = 0.0_f64;
        for pair in poses.windows(2).chain((poses.len() == 1).then_some(&poses[..])) {
            let to = pair[pair.len() - 1];
            let mut before = pair[0];
            for i in 0..=400 {
                let pose = pair[0].lerp_slerp(&to, f64::from(i) / 400.0);
                let step = (pose.translation.vector - before.translation.vector).norm()
                    + half.norm() * pose.rotation.angle_to(&before.rotation);
                reached = reached.max(step);
                before = pose;
                let shape = OrientedBox { pose, half_extents_m: half };
                if let Some(one) = query.clearance(&shape, least.min(1e9)).unwrap() {
                    least = one.distance_m;
                }
            }
        }
        let Some(found) = found else {
            prop_assert!(voxels.is_empty());
            return Ok(());
        };
        // Between two samples no point of the box moves more than a step; poses far from the origin
        // round as such.
        let rounding_m = 1e-9 + 1e-14 * world.datum_m.norm();
        let allowed_m = 0.1 * voxels.lattice().packing_radius_m();
        prop_assert!(found.distance_m <= least + rounding_m, "{found:?} {least}");
        prop_assert!(found.distance_m >= least - reached - allowed_m - rounding_m);
    }

    #[test]
    fn more_voxels_and_larger_shapes_are_never_clearer(
        world in any_world(60),
        pose in any_pose(3.0),
        half in any_half_extents(),
        more in any_offset(2.0),
    ) {
        let shift = Translation3::from(world.datum_m);
        let shape = OrientedBox { pose: shift * pose, half_extents_m: half };
        let of = |voxels: &VoxelList, shape: &OrientedBox| {
            let found = Query::new(voxels).clearance(shape, f64::INFINITY).unwrap();
            found.map_or(f64::INFINITY, |found| found.distance_m)
        };
        let voxels = world.voxels();
        let clear = of(&voxels, &shape);
        let larger = OrientedBox { half_extents_m: half * 1.5, ..shape };
        prop_assert!(of(&voxels, &larger) <= clear + 1e-9);
        let mut fuller = world.clone();
        fuller.offsets_m.push(more);
        // A point the more moves no datum: the same cells stay.
        prop_assert!(of(&fuller.voxels(), &shape) <= clear + 1e-9);
    }
}

/// Shells, octree and both after another give the same cell.
#[test]
fn large_stores_answer_the_same_before_and_after_sorting() {
    for kind in LatticeKind::ALL {
        let datum = Vector3::new(4.4e5, -5.5e6, 120.0);
        let voxels = ground(kind, datum);
        let (fresh, warm) = (Query::new(&voxels), Query::new(&voxels));
        warm.nearest(&(datum + Vector3::x() * 1e5), 1).unwrap();
        for i in 0..40 {
            let t = f64::from(i);
            let at = datum + Vector3::new(9.0 * t.sin(), 9.0 * (1.7 * t).cos(), 1.0 + t.cos());
            let tiny = OrientedBox {
                pose: Isometry3::new(at, Vector3::new(t, 1.0, 0.3)),
                half_extents_m: Vector3::new(0.2, 0.1, 0.05),
            };
            let near = fresh.clearance(&tiny, 10.0).unwrap();
            assert!(near.is_some());
            assert_eq!(near, warm.clearance(&tiny, 10.0).unwrap());
            let line = Segment {
                from_m: at,
                to_m: at + Vector3::new(0.5, 0.0, 0.4),
            };
            assert_eq!(
                fresh.clearance(&line, 0.5).unwrap(),
                warm.clearance(&line, 0.5).unwrap()
            );
            // Least of all by brute force on the cells around.
            let body = Body::line(line.from_m - voxels.datum_m(), line.to_m - voxels.datum_m());
            let near = |(_, c): &(MortonKey, Vector3<f64>)| (c - body.corners[0]).norm() < 4.0;
            let around = cells(&voxels).into_iter().filter(near);
            let least = around
                .map(|(_, c)| body.distance(&cell_body(&voxels, &c)))
                .fold(f64::INFINITY, f64::min);
            let found = fresh.clearance(&line, f64::INFINITY).unwrap().unwrap();
            assert!(
                (found.distance_m - least).abs() < 1e-9,
                "{kind} {found:?} {least}"
            );
        }
    }
}

#[test]
fn a_path_is_as_clear_as_its_least_clear_leg() {
    let voxels = ground(LatticeKind::Fcc, Vector3::zeros());
    let query = Query::new(&voxels);
    let path: Vec<_> = (0..30)
        .map(|i| Vector3::new(f64::from(i) - 15.0, 2.0, 3.0 - 0.05 * f64::from(i)))
        .collect();
    let legs = path.windows(2).map(|ends| {
        let line = Segment {
            from_m: ends[0],
            to_m: ends[1],
        };
        query
            .clearance(&line, f64::INFINITY)
            .unwrap()
            .unwrap()
            .distance_m
    });
    let least = legs.fold(f64::INFINITY, f64::min);
    let whole = query.path_clearance(&path, f64::INFINITY).unwrap().unwrap();
    assert_eq!(whole.distance_m, least);
    assert!(whole.distance_m > 0.5 && whole.distance_m < 2.0);
    let one = query.path_clearance(&path[..1], f64::INFINITY).unwrap();
    assert_eq!(one, query.clearance(&path[0], f64::INFINITY).unwrap());
    assert_eq!(query.path_clearance(&path, 0.9 * least), Ok(None));
}

#[test]
fn senseless_shapes_are_refused() {
    let voxels = ground(LatticeKind::Bcc, Vector3::zeros());
    let query = Query::new(&voxels);
    let good = OrientedBox {
        pose: Isometry3::identity(),
        half_extents_m: Vector3::new(1.0, 1.0, 1.0),
    };
    for bad in [f64::NAN, f64::INFINITY, -1e13] {
        let p = Vector3::new(bad, 0.0, 0.0);
        let from_m = Vector3::zeros();
        assert!(matches!(
            query.clearance(&p, 1.0),
            Err(QueryError::Point(_))
        ));
        let line = Segment { from_m, to_m: p };
        assert!(matches!(
            query.clearance(&line, 1.0),
            Err(QueryError::Point(_))
        ));
        assert!(query.path_clearance(&[from_m, p], 1.0).is_err());
        let wide = OrientedBox {
            half_extents_m: p,
            ..good
        };
        assert!(query.clearance(&wide, 1.0).is_err());
        let mut far = good;
        far.pose.translation.vector.z = bad;
        assert!(query.swept_box_clearance(&p, &[good.pose], 1.0).is_err());
        assert!(
            query
                .swept_box_clearance(&p, &[good.pose, far.pose], 1.0)
                .is_err()
        );
    }
    let inside_out = OrientedBox {
        half_extents_m: Vector3::new(1.0, -1.0, 1.0),
        ..good
    };
    assert!(matches!(
        query.clearance(&inside_out, 1.0),
        Err(QueryError::Box(_))
    ));
    for rotation in [[0.0; 4], [f64::NAN; 4], [2.0, 0.0, 0.0, 0.0]] {
        let [w, i, j, k] = rotation;
        let mut turned = good;
        turned.pose.rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        assert!(matches!(
            query.clearance(&turned, 1.0),
            Err(QueryError::Box(_))
        ));
    }
    for bad in [f64::NAN, -1.0] {
        assert_eq!(
            query
                .is_free(&good, bad)
                .map_err(|e| matches!(e, QueryError::Distance(_))),
            Err(true)
        );
    }
    assert_eq!(query.path_clearance(&[], 1.0), Err(QueryError::EmptyPath));
    assert_eq!(
        query.swept_box_clearance(&good.half_extents_m, &[], 1.0),
        Err(QueryError::EmptyPath)
    );
    // Turning a box a million cells long takes more pieces than are allowed.
    let turned = Isometry3::new(Vector3::zeros(), Vector3::z() * 3.0);
    let long = Vector3::new(1e11, 1.0, 1.0);
    let error = query.swept_box_clearance(&long, &[good.pose, turned], 1.0);
    assert!(matches!(error, Err(QueryError::TooManyPieces(_))));
    let huge = OrientedBox {
        half_extents_m: Vector3::new(1e12, 1e12, 1e12),
        ..good
    };
    let overlap = query.clearance(&huge, 1.0).unwrap().unwrap();
    assert_eq!(overlap.distance_m, 0.0);
    assert_eq!(overlap.key, cells(&voxels)[0].0);
    assert!(huge.check().is_ok());
}
