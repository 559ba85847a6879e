//! A map prepared for calibrations.

use super::super::confusion::shares;
use super::super::likelihood::FitScale;
use super::super::search::{OccupiedGrid, SearchMap};
use super::super::{PrepareOptions, PreparedCloud, RegistrationError, SemanticCloud};

/// A map with all that a calibration looks up in it; made once, shared by all calibrations.
pub struct CalibrationMap {
    pub(super) cloud: PreparedCloud,
    pub(super) surfaces: SearchMap,
    /// The same with cells twice as large, for a look at hypotheses that are hardly right.
    pub(super) rough: SearchMap,
    pub(super) occupied: OccupiedGrid,
    pub(super) spacing_m: f64,
    pub(super) classes: Vec<(u16, f64)>,
}

impl CalibrationMap {
    /// Prepares the centroids of a map's voxels, labelled or not, given the side of a cube as large as a voxel.
    ///
    /// # Errors
    /// If there are too few points, some are not finite, or the side is not a length.
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

    /// The points of the map.
    pub fn cloud(&self) -> &PreparedCloud {
        &self.cloud
    }

    /// Expected deviation of points from this map, with noise of their own.
    pub(super) fn scale(&self, noise_m: f64) -> FitScale {
        FitScale::new(self.spacing_m, noise_m)
    }
}
