//! How far the points are from their lattice points.

use super::OFFSET_UNIT_M;
use crate::lattice::nearest_integer;

/// Distances are summed in this fraction of `OFFSET_UNIT_M`.
const DISTANCE_STEPS: f64 = 4096.0;

/// Quantization error over all inserted points.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Distortion {
    /// Number of points.
    pub points: u64,
    /// Mean squared distance divided by 3, m^2.
    pub mse_per_dimension_m2: f64,
    /// Mean distance, metres: Ryde & Brünig eq. (13).
    pub mean_distance_m: f64,
    /// Root mean squared distance, metres: the "distance error" that Table I prints.
    pub rms_m: f64,
    /// Largest distance, metres.
    pub max_distance_m: f64,
}

/// Integer sums behind [`Distortion`]; sums saturate, which keeps them associative.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct DistortionSums {
    pub(super) points: u64,
    /// Of squared distances, in `OFFSET_UNIT_M`^2.
    pub(super) squares: u128,
    /// Of distances, in `OFFSET_UNIT_M` / 4096.
    pub(super) distances: u128,
    /// The largest squared distance, in `OFFSET_UNIT_M`^2.
    pub(super) largest_square: u64,
}

impl DistortionSums {
    /// Adds a point at an offset from its lattice point, in `OFFSET_UNIT_M`, each below 2^31.
    #[inline(always)]
    pub(super) fn add_point(&mut self, offset: [i64; 3]) {
        let square = offset
            .iter()
            .map(|o| o.wrapping_mul(*o) as u64)
            .fold(0, u64::wrapping_add);
        self.points += 1;
        self.squares += u128::from(square);
        self.distances += nearest_integer((square as f64).sqrt() * DISTANCE_STEPS) as u128;
        self.largest_square = self.largest_square.max(square);
    }

    /// Adds other points.
    pub(super) fn add(&mut self, other: &DistortionSums) {
        self.points = self.points.saturating_add(other.points);
        self.squares = self.squares.saturating_add(other.squares);
        self.distances = self.distances.saturating_add(other.distances);
        self.largest_square = self.largest_square.max(other.largest_square);
    }

    /// What cannot be true if no point is more than `reach` units from its lattice point.
    pub(super) fn fault(&self, reach: u64) -> Option<String> {
        let points = u128::from(self.points);
        let largest = (self.largest_square as f64).sqrt();
        let distance_limit = points.saturating_mul((largest * DISTANCE_STEPS) as u128 + 1);
        if self.largest_square > reach.saturating_mul(reach) {
            return Some(format!(
                "the largest distance, {} m, leaves the cell",
                largest * OFFSET_UNIT_M
            ));
        }
        if self.squares > points.saturating_mul(u128::from(self.largest_square))
            || self.squares < u128::from(self.largest_square)
            || self.distances > distance_limit
        {
            return Some(format!("distortion sums {self:?} contradict each other"));
        }
        None
    }

    pub(super) fn summary(&self) -> Distortion {
        let points = self.points.max(1) as f64;
        let mean_square_m2 = self.squares as f64 / points * (OFFSET_UNIT_M * OFFSET_UNIT_M);
        Distortion {
            points: self.points,
            mse_per_dimension_m2: mean_square_m2 / 3.0,
            mean_distance_m: self.distances as f64 / points * (OFFSET_UNIT_M / DISTANCE_STEPS),
            rms_m: mean_square_m2.sqrt(),
            max_distance_m: (self.largest_square as f64).sqrt() * OFFSET_UNIT_M,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_two_points() {
        let mut sums = DistortionSums::default();
        sums.add_point([3 << 20, 0, 4 << 20]);
        sums.add_point([0, -(1 << 20), 0]);
        let d = sums.summary();
        assert_eq!(
            (d.points, d.mean_distance_m, d.max_distance_m),
            (2, 3.0, 5.0)
        );
        assert_eq!(
            (d.mse_per_dimension_m2, d.rms_m),
            (13.0 / 3.0, 13.0_f64.sqrt())
        );
        assert_eq!(sums.fault(5 << 20), None);
    }

    #[test]
    fn no_points_have_no_distortion() {
        let d = DistortionSums::default().summary();
        assert_eq!(
            (d.points, d.mean_distance_m, d.rms_m, d.max_distance_m),
            (0, 0.0, 0.0, 0.0)
        );
    }

    #[test]
    fn sums_that_no_points_have_are_found() {
        let good = DistortionSums {
            points: 2,
            squares: 10,
            distances: 4 * 4096,
            largest_square: 9,
        };
        assert_eq!(good.fault(3), None);
        assert!(good.fault(2).is_some());
        assert!(
            DistortionSums {
                squares: 19,
                ..good
            }
            .fault(3)
            .is_some()
        );
        assert!(DistortionSums { squares: 8, ..good }.fault(3).is_some());
        assert!(DistortionSums { points: 0, ..good }.fault(3).is_some());
        assert!(
            DistortionSums {
                distances: 7 * 4096,
                ..good
            }
            .fault(3)
            .is_some()
        );
        assert!(
            DistortionSums {
                largest_square: u64::MAX,
                ..good
            }
            .fault(3)
            .is_some()
        );
    }
}
