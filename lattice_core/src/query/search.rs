//! Interface of searches through occupied cells.

use nalgebra::Vector3;

use crate::lattice::MortonKey;

/// Visitor of occupied cells, nearest first as far as possible; frame of the datum, metres.
///
/// [`Search::visit`] is called for every occupied cell whose centre is within [`Search::reach_m`], which may shrink
/// during the search.
pub(super) trait Search {
    /// Ball that contains the whole query.
    fn ball(&self) -> (Vector3<f64>, f64);

    /// Lower bound of the distance from the query to a point, up to rounding.
    fn distance_m(&self, point_m: &Vector3<f64>) -> f64;

    /// Distance beyond which centres are skipped.
    fn reach_m(&self) -> f64;

    /// Visits an occupied cell.
    fn visit(&mut self, key: MortonKey, center_m: &Vector3<f64>);

    /// Restarts: all cells will be visited again; the reach may stay.
    fn restart(&mut self);
}

/// Factor above the rounding of a distance, so that bounds are conservative.
pub(super) fn slack_m(distance_m: f64, cell_radius_m: f64) -> f64 {
    1e-9 * cell_radius_m + 1e-14 * distance_m
}
