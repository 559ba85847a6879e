//! Distance fields.

use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::query::{Bounds, Query, QueryError};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::worlds::{any_offset, any_world, cells, ground};

/// Cells with centres in the box, found among all of a cube of indices.
fn cells_in(lattice: &Lattice, bounds: &Bounds, datum_m: &Vector3<f64>) -> Vec<MortonKey> {
    let inverse = lattice.generator().try_inverse().unwrap();
    let middle = inverse * (0.5 * (bounds.min_m + bounds.max_m) - datum_m);
    let m = middle.map(|x| x.round() as i32);
    let mut keys = Vec::new();
    for x in -14..=14 {
        for y in -14..=14 {
            for z in -14..=14 {
                let w = [m.x + x, m.y + y, m.z + z];
                let local = Bounds {
                    min_m: bounds.min_m - datum_m,
                    max_m: bounds.max_m - datum_m,
                };
                if local.contains(&lattice.center(w)) {
                    keys.push(MortonKey::pack(w).unwrap());
                }
            }
        }
    }
    keys.sort();
    keys
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn fields_are_those_of_brute_force(
        mut world in any_world(40),
        middle in any_offset(3.0),
        half in prop::array::uniform3(0.0..1.2_f64),
        max_m in prop_oneof![Just(f64::INFINITY), 0.0..2.0],
    ) {
        world.cell_volume_m3 = world.cell_volume_m3.max(0.1);
        let voxels = world.voxels();
        let (middle, half) = (world.datum_m + middle, Vector3::from(half));
        let bounds = Bounds { min_m: middle - half, max_m: middle + half };
        let field = Query::new(&voxels).distance_field(&bounds, max_m, 100_000).unwrap();
        let expected = cells_in(voxels.lattice(), &bounds, &voxels.datum_m());
        prop_assert_eq!(&field.keys, &expected);
        let occupied = cells(&voxels);
        for (i, key) in expected.into_iter().enumerate() {
            let center = voxels.lattice().center(key.unpack());
            let distances = occupied.iter().map(|(_, c)| (c - center).norm());
            let least = distances.fold(f64::INFINITY, f64::min);
            let least = if least <= max_m { least } else { f64::INFINITY };
            prop_assert_eq!(field.distance_m[i], least);
            prop_assert_eq!(field.at(key), Some(least));
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_field() {
    for kind in LatticeKind::ALL {
        let voxels = ground(kind, Vector3::new(4.4e5, -5.5e6, 120.0));
        let middle = voxels.datum_m();
        let half = Vector3::new(4.0, 4.0, 2.0);
        let bounds = Bounds {
            min_m: middle - half,
            max_m: middle + half,
        };
        let field = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let query = Query::new(&voxels);
            let field = || query.distance_field(&bounds, 3.0, 100_000).unwrap();
            pool.build().unwrap().install(field)
        };
        let one = field(1);
        assert!(one.keys.len() > 8000, "{}", one.keys.len());
        assert_eq!(one, field(2));
        assert_eq!(one, field(5));
    }
}

#[test]
fn boxes_that_are_too_large_or_senseless_are_refused() {
    let voxels = ground(LatticeKind::Fcc, Vector3::zeros());
    let query = Query::new(&voxels);
    let cube = |low: f64, high: f64| Bounds {
        min_m: Vector3::repeat(low),
        max_m: Vector3::repeat(high),
    };
    for side in [20.0, 1e6, 1e12] {
        let error = query
            .distance_field(&cube(-side, side), 1.0, 100_000)
            .unwrap_err();
        let QueryError::TooManyCells { cells, max_cells } = error else {
            panic!("{error}");
        };
        assert!(cells > 1e6 && max_cells == 100_000);
    }
    // A thin plate has few cells in volume but must not loop for ever.
    let mut plate = cube(-1e12, 1e12);
    plate.min_m.z = 0.0;
    plate.max_m.z = 0.0;
    assert!(query.distance_field(&plate, 1.0, usize::MAX).is_err());
    assert!(matches!(
        query.distance_field(&cube(1.0, -1.0), 1.0, 10),
        Err(QueryError::Box(_))
    ));
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(query.distance_field(&cube(0.0, bad), 1.0, 10).is_err());
    }
    assert!(
        query
            .distance_field(&cube(0.0, 1.0), f64::NAN, 100)
            .is_err()
    );
    // Out of the range of keys there are no cells.
    let far = query
        .distance_field(&cube(9e8, 9e8 + 1.0), 1.0, 1000)
        .unwrap();
    assert_eq!((far.keys.len(), far.distance_m.len()), (0, 0));
}
