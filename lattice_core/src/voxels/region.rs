//! Boxes of the map frame that cells are removed from.

use nalgebra::Vector3;
use thiserror::Error;

use crate::lattice::{Lattice, LatticeIndex, MortonKey};

/// Numbers that do not bound a region.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum RegionError {
    /// Some corner is NaN, or the lower is above the upper.
    #[error("corners {min_m:?} and {max_m:?} m do not bound a box: give the lower one first")]
    Corners {
        /// The lower corner, metres.
        min_m: [f64; 3],
        /// The upper corner, metres.
        max_m: [f64; 3],
    },
}

/// A closed box in the map frame; a cell is in it if its centre is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Region {
    min_m: Vector3<f64>,
    max_m: Vector3<f64>,
}

impl Region {
    /// The box between two corners (map frame, metres), along the axes; infinite ones are allowed.
    pub fn cuboid(min_m: Vector3<f64>, max_m: Vector3<f64>) -> Result<Region, RegionError> {
        if min_m.iter().zip(&max_m).all(|(min, max)| min <= max) {
            return Ok(Region { min_m, max_m });
        }
        let (min_m, max_m) = (min_m.into(), max_m.into());
        Err(RegionError::Corners { min_m, max_m })
    }

    /// True if the point (map frame, metres) is inside or on the border.
    fn contains(&self, p: &Vector3<f64>) -> bool {
        self.contains_ball(p, 0.0) == Some(true)
    }

    /// True if all of a ball is inside, false if all is outside; `None` if neither is sure.
    fn contains_ball(&self, p: &Vector3<f64>, reach: f64) -> Option<bool> {
        let (min, max) = (&self.min_m, &self.max_m);
        let inside = (0..3).all(|i| min[i] <= p[i] - reach && p[i] + reach <= max[i]);
        let outside = (0..3).any(|i| p[i] + reach < min[i] || max[i] < p[i] - reach);
        (inside || outside).then_some(inside)
    }

    pub(super) fn of_cells(&self, lattice: &Lattice, datum_m: Vector3<f64>) -> CellsOf {
        let g = lattice.generator();
        let corner = |i: i32| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { 3.5 } else { -3.5 };
            (g * Vector3::new(sign(0), sign(1), sign(2))).norm()
        };
        CellsOf {
            region: *self,
            lattice: lattice.clone(),
            datum_m,
            middle_m: g * Vector3::repeat(3.5),
            // The covering radius is far above all roundings.
            reach_m: (0..4).map(corner).fold(0.0, f64::max) + lattice.covering_radius_m(),
        }
    }
}

/// The cells in a region.
pub(super) struct CellsOf {
    region: Region,
    lattice: Lattice,
    datum_m: Vector3<f64>,
    /// From the lowest lattice point of a block to its middle.
    middle_m: Vector3<f64>,
    /// No lattice point of a block is farther from its middle.
    reach_m: f64,
}

impl CellsOf {
    pub(super) fn is_inside(&self, key: MortonKey) -> bool {
        let center_m = self.datum_m + self.lattice.center(key.unpack());
        self.region.contains(&center_m)
    }

    /// The answer for all cells of a block, given by its lowest index, if they agree.
    pub(super) fn block_is_inside(&self, first: LatticeIndex) -> Option<bool> {
        let middle_m = self.datum_m + self.lattice.center(first) + self.middle_m;
        self.region.contains_ball(&middle_m, self.reach_m)
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
        assert_eq!(
            below.contains_ball(&Vector3::new(0.0, 0.0, -9.0), 10.0),
            Some(true)
        );
        assert_eq!(
            below.contains_ball(&Vector3::new(0.0, 0.0, 9.0), 10.0),
            None
        );
        assert_eq!(
            below.contains_ball(&Vector3::new(0.0, 0.0, 13.0), 10.0),
            Some(false)
        );
        let nan = Vector3::new(0.0, f64::NAN, 0.0);
        assert!(Region::cuboid(nan, high).is_err());
        assert!(Region::cuboid(high, Vector3::zeros()).is_err());
    }
}
