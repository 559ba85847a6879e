//! Distortion: distances of the points from their lattice points.

use crate::lattice::{BatchSums, Lattice};

/// Resolution of the sums: fraction of a cell size for distances, of its square for squares.
const STEPS: f64 = (1_u64 << 20) as f64;
/// Maximum relative excess of a squared distance over the largest in a cell.
const SLACK: f64 = 0.02;

/// Quantization error over all inserted points.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Distortion {
    /// Number of points.
    pub points: u64,
    /// Mean squared distance divided by 3, m^2.
    pub mse_per_dimension_m2: f64,
    /// Mean distance, metres: Ryde & Brünig eq. (13).
    pub mean_distance_m: f64,
    /// RMS distance, metres: the "distance error" of Table I.
    pub rms_m: f64,
    /// Maximum distance, metres.
    pub max_distance_m: f64,
}

/// Integer sums of [`Distortion`]; they saturate and stay associative.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct DistortionSums {
    /// Number of points.
    pub points: u64,
    /// Sum of squared distances, in cell sizes^2 / 2^20.
    pub squares: u128,
    /// Sum of distances, in cell sizes / 2^20.
    pub distances: u128,
    /// Maximum squared distance, in cell sizes^2 / 2^20.
    pub largest_square: u64,
}

impl DistortionSums {
    #[inline]
    pub(super) fn add_batch(&mut self, batch: &BatchSums) {
        self.add(&DistortionSums {
            points: batch.points,
            squares: batch.squares.into(),
            distances: batch.distances.into(),
            largest_square: batch.largest_square,
        });
    }

    /// Adds the sums of other points.
    pub fn add(&mut self, other: &DistortionSums) {
        self.points = self.points.saturating_add(other.points);
        self.squares = self.squares.saturating_add(other.squares);
        self.distances = self.distances.saturating_add(other.distances);
        self.largest_square = self.largest_square.max(other.largest_square);
    }

    /// Scales the sums to `count` points of equal distortion.
    pub fn of_part(&self, points: u64) -> DistortionSums {
        let part = |sum| scaled(sum, points, self.points);
        DistortionSums {
            points,
            squares: part(self.squares),
            distances: part(self.distances),
            // The maximum of a part is at most its sum.
            largest_square: u128::from(self.largest_square).min(part(self.squares)) as u64,
        }
    }

    /// Contradiction between these sums and points in cells of the lattice.
    pub(super) fn contradiction(&self, lattice: &Lattice) -> Option<String> {
        let points = u128::from(self.points);
        let reach = lattice.covering_radius_m() / lattice.cell_side_m();
        // A point on the border may have been assigned to the adjacent cell.
        let reach_square = reach * reach * (1.0 + SLACK) * STEPS + 1.0;
        let largest = self.largest_square as f64;
        if largest > reach_square {
            let largest_m = (largest / STEPS).sqrt() * lattice.cell_side_m();
            return Some(format!(
                "the largest distance, {largest_m} m, leaves the cell"
            ));
        }
        // The square is rounded, so the distance is not its exact root.
        let distance_limit = points.saturating_mul(((largest + 1.0) * STEPS).sqrt() as u128 + 2);
        if self.squares > points.saturating_mul(u128::from(self.largest_square))
            || self.squares < u128::from(self.largest_square)
            || self.distances > distance_limit
        {
            return Some(format!("distortion sums {self:?} contradict each other"));
        }
        None
    }

    pub(super) fn summary(&self, lattice: &Lattice) -> Distortion {
        let points = self.points.max(1) as f64;
        let side_m = lattice.cell_side_m();
        let mean_square_m2 = self.squares as f64 / points / STEPS * (side_m * side_m);
        Distortion {
            points: self.points,
            mse_per_dimension_m2: mean_square_m2 / 3.0,
            mean_distance_m: self.distances as f64 / points / STEPS * side_m,
            rms_m: mean_square_m2.sqrt(),
            max_distance_m: (self.largest_square as f64 / STEPS).sqrt() * side_m,
        }
    }
}

/// Scales a sum by `part` / `whole`, rounded down; saturates.
pub(super) fn scaled(sum: u128, part: u64, whole: u64) -> u128 {
    let (part, whole) = (u128::from(part), u128::from(whole.max(1)));
    let rest = (sum % whole).saturating_mul(part) / whole;
    (sum / whole).saturating_mul(part).saturating_add(rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::LatticeKind;

    fn lattice() -> Lattice {
        Lattice::new(LatticeKind::Fcc, 8.0).unwrap()
    }

    #[test]
    fn statistics_of_two_points() {
        let sums = DistortionSums {
            points: 2,
            squares: (1 << 18) + (1 << 16),
            distances: (1 << 19) + (1 << 18),
            largest_square: 1 << 18,
        };
        let d = sums.summary(&lattice());
        assert_eq!((d.points, d.mean_distance_m), (2, 0.75));
        assert_eq!((d.rms_m, d.max_distance_m), (0.625_f64.sqrt(), 1.0));
        assert_eq!(d.mse_per_dimension_m2, 0.625 / 3.0);
        assert_eq!(sums.contradiction(&lattice()), None);
        let none = DistortionSums::default().summary(&lattice());
        assert_eq!(
            (none.points, none.mean_distance_m, none.rms_m),
            (0, 0.0, 0.0)
        );
    }

    #[test]
    fn sums_that_no_points_have_are_found() {
        let good = DistortionSums {
            points: 2,
            squares: 10 << 10,
            distances: 4 << 10,
            largest_square: 9 << 10,
        };
        let contradicts = |sums: DistortionSums| sums.contradiction(&lattice()).is_some();
        assert!(!contradicts(good));
        // Seen: near a centre the rounding of the square is much of the distance.
        assert!(!contradicts(DistortionSums {
            points: 2,
            squares: 228,
            distances: 21_894,
            largest_square: 114,
        }));
        let squares = |squares| DistortionSums { squares, ..good };
        assert!(contradicts(squares(19 << 10)));
        assert!(contradicts(squares(8 << 10)));
        assert!(contradicts(DistortionSums { points: 0, ..good }));
        let distances = 1 << 20;
        assert!(contradicts(DistortionSums { distances, ..good }));
        let largest_square = 1 << 20;
        assert!(contradicts(DistortionSums {
            largest_square,
            ..squares(1 << 20)
        }));
    }
}
