//! Interface of searches through occupied cells.

use nalgebra::Vector3;

use crate::lattice::MortonKey;

/// Looks at occupied cells, nearest first as far as possible. Frame of the datum, metres.
///
/// [`Search::visit`] is called for every occupied cell whose centre is within [`Search::reach_m`],
/// which may shrink on the way.
pub(super) trait Search {
    /// A ball that holds the whole query.
    fn ball(&self) -> (Vector3<f64>, f64);

    /// A lower bound of the distance from the query to a point; its rounding does not matter.
    fn distance_m(&self, point_m: &Vector3<f64>) -> f64;

    /// Centres beyond this are of no interest.
    fn reach_m(&self) -> f64;

    /// An occupied cell.
    fn visit(&mut self, key: MortonKey, center_m: &Vector3<f64>);

    /// All cells will be visited again; the reach may stay.
    fn restart(&mut self);
}

/// More than the rounding of a distance, so that bounds never cut off what they should not.
pub(super) fn slack_m(distance_m: f64, cell_radius_m: f64) -> f64 {
    1e-9 * cell_radius_m + 1e-14 * distance_m
}
