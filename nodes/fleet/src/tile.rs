//! Tiles: cubes of 256 x 256 x 256 lattice indices that partition the tables.

use lattice_core::lattice::MortonKey;

/// Log2 of the lattice indices along the side of a tile.
pub const TILE_LOG2: u32 = 8;

/// Number of a tile: the Morton interleave of its position, a [`MortonKey`] without the lowest bits.
pub type Tile = i64;

/// Tile of a cell by its absolute index; `None` for cells more than 2^28 from the origin.
pub fn tile_of(cell: [i64; 3]) -> Option<Tile> {
    let place = cell.map(|w| i32::try_from(w >> TILE_LOG2).ok());
    let [Some(x), Some(y), Some(z)] = place else {
        return None;
    };
    i64::try_from(MortonKey::pack([x, y, z])?.raw()).ok()
}

/// Order of the cells within their tile: the Morton interleave of the low bits.
pub fn order_in_tile(cell: [i64; 3]) -> u64 {
    let low = cell.map(|w| (w & ((1 << TILE_LOG2) - 1)) as i32);
    MortonKey::pack(low).map_or(0, MortonKey::raw)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Cells of one tile are next to each other in the order of keys.
        #[test]
        fn a_tile_is_a_prefix_of_keys(cells in prop::collection::vec(prop::array::uniform3(-5000_i64..5000), 2..20)) {
            let mut by_key = cells.clone();
            by_key.sort_by_key(|cell| MortonKey::pack(cell.map(|w| w as i32)).unwrap());
            let mut by_tile = cells;
            by_tile.sort_by_key(|cell| (tile_of(*cell).unwrap(), order_in_tile(*cell)));
            prop_assert_eq!(by_key, by_tile);
        }
    }

    #[test]
    fn cells_too_far_away_have_no_tile() {
        assert!(tile_of([(1 << 28) - 1, -(1 << 28), 0]).is_some());
        assert_eq!(tile_of([1 << 28, 0, 0]), None);
        assert_eq!(tile_of([i64::MIN, 0, i64::MAX]), None);
    }
}
