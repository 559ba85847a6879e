//! Target map, prepared for global registration.

use super::super::confusion::shares;
use super::super::likelihood::FitScale;
use super::super::search::{OccupiedGrid, SearchMap};
use super::super::{PrepareOptions, PreparedCloud, RegistrationError, SemanticCloud};

/// Target map with its search structures; prepared once, shared by all registrations.
pub struct CalibrationMap {
    /// Voxel centroids with normals.
    pub(super) cloud: PreparedCloud,
    /// Search grid by surfaces.
    pub(super) surfaces: SearchMap,
    /// Search grid with cells twice as large, for the rough search.
    pub(super) rough: SearchMap,
    /// Occupied cells, for lines of sight.
    pub(super) occupied: OccupiedGrid,
    /// Spacing of the points: the cell size, metres.
    pub(super) spacing_m: f64,
    /// Fractions of the label classes.
    pub(super) classes: Vec<(u16, f64)>,
}

impl CalibrationMap {
    /// Prepares the voxel centroids of a map, labelled or not, given its cell size.
    ///
    /// # Errors
    /// Fails if the cell size is not positive, there are too few points, or a point is not finite.
    pub fn new(
        cloud: SemanticCloud,
        cell_side_m: f64,
    ) -> Result<CalibrationMap, RegistrationError> {
        if !(cell_side_m.is_finite() && cell_side_m > 0.0) {
            return Err(RegistrationError::CellSide { cell_side_m });
        }
        let cloud = PreparedCloud::new(cloud, &PrepareOptions::default())?;
        let surfaces = SearchMap::of_surfaces(&cloud, cell_side_m);
        let rough = SearchMap::rough(&cloud, cell_side_m);
        let occupied = OccupiedGrid::new(cloud.points_m(), cloud.normals(), 2.0 * cell_side_m);
        let (Some(surfaces), Some(rough), Some(occupied)) = (surfaces, rough, occupied) else {
            return Err(RegistrationError::TooFewPoints {
                points: 0,
                least: 1,
            });
        };
        Ok(CalibrationMap {
            classes: shares(&cloud),
            cloud,
            surfaces,
            rough,
            occupied,
            spacing_m: cell_side_m,
        })
    }

    /// Points of the map.
    pub fn cloud(&self) -> &PreparedCloud {
        &self.cloud
    }

    /// Expected residuals of points with noise `noise_m` against this map.
    pub(super) fn scale(&self, noise_m: f64) -> FitScale {
        FitScale::new(self.spacing_m, noise_m)
    }
}
