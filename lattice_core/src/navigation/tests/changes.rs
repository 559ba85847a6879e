//! The grid after any history is that of the map as it is.

use proptest::prelude::*;

use super::world::Random;
use super::*;

/// Voxel that a history sets, at one of few places so that they meet.
fn voxel(random: &mut Random, kind: LatticeKind) -> (MortonKey, Vector3<f64>) {
    let lattice = Lattice::new(kind, 0.008).unwrap();
    let [x, y] = [random.next(), random.next()].map(|value| 3.0 * value);
    let z = match random.next() {
        tall if tall < 0.15 => 2.5 * random.next(),
        _ => 0.1 * x,
    };
    let at_m = Vector3::new(x, y, z);
    let w = lattice.quantize(&at_m).unwrap();
    (MortonKey::pack(w).unwrap(), at_m - lattice.center(w))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_grid_after_any_history_is_that_of_the_map(seed in any::<u64>(), is_flat in any::<bool>()) {
        let mut random = Random(seed);
        let kind = LatticeKind::ALL[(random.next() * 6.0) as usize];
        let lattice = Lattice::new(kind, 0.008).unwrap();
        let mut options = ProjectorOptions::default();
        if is_flat {
            options.rule = ProjectionRule::Flat { min_z_m: 0.2, max_z_m: 1.0 };
        }
        let new = || Projector::new(&lattice, Vector3::zeros(), options).unwrap();
        let mut projector = new();
        let mut map = std::collections::BTreeMap::new();
        let robot = [None, Some(Vector3::new(1.0, 1.0, 0.3))];
        for round in 0..5 {
            for _ in 0..(600.0 * random.next()) as usize {
                let (key, offset) = voxel(&mut random, kind);
                map.insert(key, offset);
                projector.set(key, Some(offset));
            }
            let removed: Vec<_> = map.keys().copied().filter(|_| random.next() < 0.2).collect();
            for key in removed {
                map.remove(&key);
                projector.set(key, None);
            }
            let robot_m = robot[round % 2];
            let mut fresh = new();
            let mut voxels: Vec<_> = map.iter().collect();
            voxels.sort_by_key(|(key, _)| key.raw().wrapping_mul(0x9e37_79b9_7f4a_7c15));
            voxels.iter().for_each(|(key, offset)| fresh.set(**key, Some(**offset)));
            prop_assert_eq!(
                projector.grid(robot_m, None).unwrap(),
                fresh.grid(robot_m, None).unwrap()
            );
            match (projector.grid_and_elevation(robot_m, None), fresh.grid_and_elevation(robot_m, None)) {
                (Err(error), _) => prop_assert!(is_flat && error == ProjectionError::FlatRule),
                (found, wanted) => {
                    let bits = |found: Result<(Grid, Result<Elevation, _>), ProjectionError>| {
                        let layers = found.unwrap().1.unwrap();
                        layers.layers().map(|(_, layer)| layer.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
                    };
                    prop_assert_eq!(bits(found), bits(wanted));
                }
            }
        }
        map.keys().for_each(|key| projector.set(*key, None));
        let empty = projector.grid(None, None).unwrap();
        prop_assert_eq!((empty.cells.len(), projector.states.len()), (0, 0));
    }
}

#[test]
fn a_voxel_far_away_is_refused_by_the_size_of_the_grid() {
    let lattice = Lattice::new(LatticeKind::Cubic, 0.001).unwrap();
    let mut projector = Projector::new(&lattice, Vector3::zeros(), options()).unwrap();
    for w in [[0, 0, 0], [1_000_000, 1_000_000, 0]] {
        projector.set(MortonKey::pack(w).unwrap(), Some(Vector3::zeros()));
    }
    let error = projector.grid(None, None).unwrap_err();
    assert!(matches!(error, ProjectionError::TooLarge { .. }), "{error}");
    projector.set(MortonKey::pack([0; 3]).unwrap(), None);
    assert!(projector.grid(None, None).unwrap().cells.len() < 50);
    // Not finite, as of a forged message.
    projector.set(
        MortonKey::pack([0; 3]).unwrap(),
        Some(Vector3::repeat(f64::NAN)),
    );
    assert!(projector.grid(None, None).is_ok());
}

#[test]
fn the_flat_rule_is_that_of_octomap_server() {
    let lattice = Lattice::new(LatticeKind::Cubic, 0.125).unwrap();
    let rule = ProjectionRule::Flat {
        min_z_m: 0.2,
        max_z_m: 1.2,
    };
    let options = ProjectorOptions { rule, ..options() };
    let mut projector = Projector::new(&lattice, Vector3::zeros(), options).unwrap();
    let key = |w| MortonKey::pack(w).unwrap();
    let inside = Vector3::repeat(0.1);
    for w in [[0, 0, 1], [1, 0, 0], [2, 0, 5]] {
        projector.set(key(w), Some(inside));
    }
    let grid = projector.grid(None, None).unwrap();
    assert_eq!(grid.cells, [Cell::Occupied, Cell::Unknown, Cell::Unknown]);
    let free = FreeCells {
        lattice: lattice.scaled(2.0).unwrap(),
        datum_m: Vector3::new(0.5, 0.5, 0.5),
        keys: vec![key([0, 0, 0])],
    };
    let grid = projector.grid(None, Some(&free)).unwrap();
    // The free cube covers two columns a side.
    assert_eq!((grid.width, grid.height, grid.corner), (3, 2, [0, 0]));
    let row = [Cell::Occupied, Cell::Free, Cell::Unknown];
    assert_eq!(
        grid.cells,
        [row, [Cell::Free, Cell::Free, Cell::Unknown]].concat()
    );
}
