//! Positions of a path within a radius of a point, found in a time that does not depend on their number.

use nalgebra::Vector3;
use rustc_hash::FxHashMap;

use crate::lattice::{Lattice, LatticeError, LatticeIndex, LatticeKind};

/// Cells per radius: 1.3 leaves 87 FCC cells to visit.
const CELLS_PER_RADIUS: f64 = 1.3;

/// Positions by lattice cell.
#[derive(Clone, Debug)]
pub struct PlaceHistory {
    lattice: Lattice,
    radius_m: f64,
    /// Steps to all cells that may hold a position within the radius.
    steps: Vec<LatticeIndex>,
    places: FxHashMap<LatticeIndex, Vec<(u32, Vector3<f64>)>>,
}

impl PlaceHistory {
    /// Creates an empty history for queries with a radius, metres.
    ///
    /// # Errors
    /// If the radius is not positive and finite, or gives cells beyond the limits of [`Lattice::new`].
    pub fn new(radius_m: f64) -> Result<PlaceHistory, LatticeError> {
        let side_m = radius_m / CELLS_PER_RADIUS;
        let lattice = Lattice::new(LatticeKind::Fcc, side_m.powi(3))?;
        // Two positions lie in cells whose centres are no farther apart than the positions and two circumradii.
        let reach_m = radius_m + 2.0 * lattice.covering_radius_m();
        let bound = (2.0 * reach_m / lattice.packing_radius_m()).ceil() as i32;
        let range = || -bound..=bound;
        let all = range().flat_map(|a| range().flat_map(move |b| range().map(move |c| [a, b, c])));
        let steps = all
            .filter(|step| lattice.center(*step).norm() <= reach_m)
            .collect();
        Ok(PlaceHistory {
            lattice,
            radius_m,
            steps,
            places: FxHashMap::default(),
        })
    }

    /// Radius of all queries, m.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Number of cells that a query visits.
    pub fn cells_visited(&self) -> usize {
        self.steps.len()
    }

    /// Removes all positions.
    pub fn clear(&mut self) {
        self.places.clear();
    }

    /// Adds a position (metres) with its number. Positions beyond the range of the lattice are ignored.
    pub fn add(&mut self, number: u32, place_m: &Vector3<f64>) {
        if let Some(index) = self.lattice.quantize(place_m) {
            let cell = self.places.entry(index).or_default();
            cell.push((number, *place_m));
        }
    }

    /// Numbers and distances (m) of all positions within the radius, nearest first.
    pub fn near(&self, place_m: &Vector3<f64>) -> Vec<(u32, f64)> {
        let Some(index) = self.lattice.quantize(place_m) else {
            return Vec::new();
        };
        let cells = self.steps.iter().filter_map(|step| {
            let cell = [0, 1, 2].map(|i| index[i].wrapping_add(step[i]));
            self.places.get(&cell)
        });
        let places = cells.flatten();
        let mut near: Vec<(u32, f64)> = places
            .map(|(number, place)| (*number, (place - place_m).norm()))
            .filter(|(_, distance_m)| *distance_m <= self.radius_m)
            .collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        near
    }
}
