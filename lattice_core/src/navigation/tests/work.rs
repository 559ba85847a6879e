//! Each column is computed once, and anew only where samples changed.

use super::world::{Mapped, World};
use super::*;

/// Columns of a square whose edge is this much longer than one column.
fn square(reach: i32) -> u64 {
    (2 * reach as u64 + 1).pow(2)
}

#[test]
fn columns_are_gathered_once_and_again_only_around_changes() {
    let world = World::default()
        .floor([0.0, 0.0], [30.0, 30.0], 0.0)
        .solid([10.0, 10.0, 0.0], [12.0, 12.0, 1.0]);
    for kind in KINDS {
        let mapped = Mapped::new(&world, kind, 0.1, 2);
        let mut projector = mapped.projector(options());
        let columns = &projector.columns;
        let (reach, stride) = (columns.reach(), columns.stride());
        let around = projector.changed.around(reach).rows();
        let expected: usize = around.values().map(Vec::len).sum();
        assert!(expected > 50_000, "many batches: {expected}");

        let ProjectionRule::Ground(ground) = projector.options.rule else {
            panic!("no ground");
        };
        projector.ground_map().unwrap();
        assert_eq!(projector.gathered, expected as u64, "{kind}");
        // Neither a goal nor a robot that moved changes the surfaces.
        let graph = projector.graph(&ground).unwrap();
        projector.ground_map().unwrap();
        projector
            .grid(Some(Vector3::new(1.0, 1.0, 0.3)), None)
            .unwrap();
        projector
            .grid(Some(Vector3::new(9.0, 1.0, 0.3)), None)
            .unwrap();
        assert_eq!(projector.gathered, expected as u64, "{kind}");
        assert!(Arc::ptr_eq(&graph, &projector.graph(&ground).unwrap()));

        let (key, voxel) = mapped.list.sorted()[1000];
        let offset_m = Vector3::from(voxel.mean_offset_m());
        projector.set(key, Some(offset_m));
        projector.ground_map().unwrap();
        assert_eq!(projector.gathered, expected as u64, "no change");
        projector.set(key, None);
        projector.ground_map().unwrap();
        let again = projector.gathered - expected as u64;
        assert!(
            (square(reach)..=square(reach + terrain::REACH * stride)).contains(&again),
            "{kind}: {again}"
        );
        assert!(!Arc::ptr_eq(&graph, &projector.graph(&ground).unwrap()));
    }
}
