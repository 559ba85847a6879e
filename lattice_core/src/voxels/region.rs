//! Boxes of the map frame from which cells are removed.

use nalgebra::Vector3;
use thiserror::Error;

use super::store::block_mask::{BlockMask, places};
use crate::lattice::{BlockKey, Lattice};

/// Corners that do not bound a region: NaN, or the lower above the upper.
#[derive(Clone, PartialEq, Debug, Error)]
#[error("corners {min_m:?} and {max_m:?} m do not bound a box: give the lower one first")]
#[expect(missing_docs, reason = "the messages name the fields")]
pub struct RegionError {
    pub min_m: [f64; 3],
    pub max_m: [f64; 3],
}

/// Closed box in the map frame; it contains the cells whose centre is inside.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Region {
    min_m: Vector3<f64>,
    max_m: Vector3<f64>,
}

impl Region {
    /// Creates the axis-aligned box between two corners (map frame, metres), which may be infinite.
    pub fn cuboid(min_m: Vector3<f64>, max_m: Vector3<f64>) -> Result<Region, RegionError> {
        if min_m.iter().zip(&max_m).all(|(min, max)| min <= max) {
            return Ok(Region { min_m, max_m });
        }
        let (min_m, max_m) = (min_m.into(), max_m.into());
        Err(RegionError { min_m, max_m })
    }

    /// Tests whether a point (map frame, metres) is inside or on the border.
    pub fn contains(&self, p: &Vector3<f64>) -> bool {
        self.contains_ball(p, 0.0) == Some(true)
    }

    /// True if a ball is entirely inside, false if entirely outside; `None` if neither is certain.
    fn contains_ball(&self, center_m: &Vector3<f64>, radius_m: f64) -> Option<bool> {
        let (low, high) = (
            center_m.add_scalar(-radius_m),
            center_m.add_scalar(radius_m),
        );
        let inside = (0..3).all(|i| self.min_m[i] <= low[i] && high[i] <= self.max_m[i]);
        let outside = (0..3).any(|i| high[i] < self.min_m[i] || self.max_m[i] < low[i]);
        (inside || outside).then_some(inside)
    }
}

/// Cells of a lattice with their centre in a region, selected by blocks of 8 x 8 x 8 indices.
pub(super) struct CellsInside {
    region: Region,
    lattice: Lattice,
    datum_m: Vector3<f64>,
    /// Offset from the lowest lattice point of a block to its centre.
    middle_m: Vector3<f64>,
    /// Radius about the centre that contains all lattice points of a block.
    radius_m: f64,
}

impl CellsInside {
    pub(super) fn new(region: &Region, lattice: &Lattice, datum_m: Vector3<f64>) -> CellsInside {
        let generator = lattice.generator();
        let corner_m = |i: i32| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { 3.5 } else { -3.5 };
            (generator * Vector3::new(sign(0), sign(1), sign(2))).norm()
        };
        CellsInside {
            region: *region,
            lattice: lattice.clone(),
            datum_m,
            middle_m: generator * Vector3::repeat(3.5),
            // The covering radius is far above all rounding errors.
            radius_m: (0..4).map(corner_m).fold(0.0, f64::max) + lattice.covering_radius_m(),
        }
    }

    /// Cells of a block's mask that are in the region.
    pub(super) fn of_block(&self, block: u64, leaf: &BlockMask) -> Vec<BlockKey> {
        let center_m = |cell: BlockKey| self.datum_m + self.lattice.center(cell.unpack());
        let first_m = BlockKey::from_raw(block << 9).map(center_m);
        let all = first_m.and_then(|first_m| {
            self.region
                .contains_ball(&(first_m + self.middle_m), self.radius_m)
        });
        if all == Some(false) {
            return Vec::new();
        }
        let cells = places(leaf).filter_map(|place| BlockKey::from_raw(block << 9 | place as u64));
        let inside = |cell: &BlockKey| all.is_some() || self.region.contains(&center_m(*cell));
        cells.filter(inside).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_is_inside() {
        let region = Region::cuboid(Vector3::zeros(), Vector3::repeat(1.0)).unwrap();
        assert!(region.contains(&Vector3::zeros()) && region.contains(&Vector3::repeat(1.0)));
        assert!(!region.contains(&Vector3::new(0.5, 0.5, 1.0 + 1e-15)));
        assert!(!region.contains(&Vector3::repeat(f64::NAN)));
    }

    #[test]
    fn regions_may_be_unbounded_but_not_senseless() {
        let high = Vector3::new(f64::INFINITY, f64::INFINITY, 2.0);
        let below = Region::cuboid(-Vector3::repeat(f64::INFINITY), high).unwrap();
        assert!(below.contains(&Vector3::new(1e9, -1e9, 2.0)));
        for (z, answer) in [(-9.0, Some(true)), (9.0, None), (13.0, Some(false))] {
            let center_m = Vector3::new(0.0, 0.0, z);
            assert_eq!(below.contains_ball(&center_m, 10.0), answer);
        }
        let nan = Vector3::new(0.0, f64::NAN, 0.0);
        assert!(Region::cuboid(nan, high).is_err());
        assert!(Region::cuboid(high, Vector3::zeros()).is_err());
    }
}
