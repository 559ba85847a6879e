//! Mappers and those who follow their maps.

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::map_follower::{Followed, MapFollower};

use crate::clouds::cloud;

/// Options of a mapper of named cells.
pub fn options(kind: LatticeKind, cell_volume_m3: f64) -> MapperOptions {
    MapperOptions::new(Lattice::new(kind, cell_volume_m3).unwrap())
}

/// An empty mapper of epoch 7.
pub fn mapper(options: MapperOptions) -> LatticeMapper {
    LatticeMapper::new(options, 7).unwrap()
}

/// Maps points of the map frame.
pub fn insert(mapper: &mut LatticeMapper, points: &[[f32; 3]]) {
    mapper.on_cloud(&cloud("map", 1, points)).unwrap();
}

/// Gives a follower a whole keyframe.
pub fn follow_keyframe(follower: &mut MapFollower, mapper: &mut LatticeMapper) {
    for chunk in mapper.keyframe() {
        assert_eq!(follower.on_map(&chunk).unwrap(), Followed::Applied);
    }
}

/// Gives a follower the next update.
pub fn follow_update(follower: &mut MapFollower, mapper: &mut LatticeMapper) {
    for chunk in mapper.take_update() {
        assert_eq!(follower.on_update(&chunk).unwrap(), Followed::Applied);
    }
}

/// A follower of a mapper, with all of its map.
pub fn follower(mapper: &mut LatticeMapper) -> MapFollower {
    let mut follower = MapFollower::new(1_000_000);
    follow_keyframe(&mut follower, mapper);
    follower
}
