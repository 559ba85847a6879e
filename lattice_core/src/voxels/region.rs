//! Boxes of the map frame that cells are removed from.

use nalgebra::Vector3;
use thiserror::Error;

/// Corners that do not bound a region: one is NaN, or the lower is above the upper.
#[derive(Clone, PartialEq, Debug, Error)]
#[error("corners {min_m:?} and {max_m:?} m do not bound a box: give the lower one first")]
#[expect(missing_docs, reason = "the messages name the fields")]
pub struct RegionError {
    pub min_m: [f64; 3],
    pub max_m: [f64; 3],
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
        Err(RegionError { min_m, max_m })
    }

    /// True if the point (map frame, metres) is inside or on the border.
    pub(super) fn contains(&self, p: &Vector3<f64>) -> bool {
        (0..3).all(|i| self.min_m[i] <= p[i] && p[i] <= self.max_m[i])
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
        let nan = Vector3::new(0.0, f64::NAN, 0.0);
        assert!(Region::cuboid(nan, high).is_err());
        assert!(Region::cuboid(high, Vector3::zeros()).is_err());
    }
}
