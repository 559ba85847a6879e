//! Residuals of a pose, to which the likelihood applies.

use nalgebra::Point3;

use crate::registration::PreparedCloud;

/// Index of the cubic region of side `side_m` that contains a point.
pub(crate) fn region_of(point: &Point3<f64>, side_m: f64) -> [i64; 3] {
    [point.x, point.y, point.z].map(|c| (c / side_m).floor() as i64)
}

/// Expected standard deviations of residuals.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FitScale {
    /// Standard deviation across a surface, metres.
    pub normal_m: f64,
    /// Standard deviation along a surface, metres; near the spacing of the map's points.
    pub tangent_m: f64,
    /// Side of the regions that limit independent points, metres.
    pub region_m: f64,
}

impl FitScale {
    /// Deviations for a map with point spacing `spacing_m` and clouds with `noise_m` of their own.
    pub fn new(spacing_m: f64, noise_m: f64) -> FitScale {
        FitScale {
            normal_m: (0.25 * spacing_m).hypot(noise_m),
            tangent_m: spacing_m.hypot(noise_m),
            region_m: 8.0 * spacing_m,
        }
    }

    /// Scales the deviations by `factor`, for coarsely refined poses.
    pub fn coarser(self, factor: f64) -> FitScale {
        FitScale {
            normal_m: self.normal_m * factor,
            tangent_m: self.tangent_m * factor,
            ..self
        }
    }

    /// Maximum distance of correspondences, metres.
    pub fn gate_m(&self) -> f64 {
        3.0 * self.tangent_m.max(self.normal_m)
    }
}

/// Likelihood model: a source divided into regions, and a target.
pub struct Fit<'a> {
    pub(super) source: &'a PreparedCloud,
    pub(super) target: &'a PreparedCloud,
    pub(super) scale: FitScale,
    /// Weight of each source point: points of a dense region share its weight.
    pub(super) weights: Vec<f64>,
    pub(super) folds: Vec<u8>,
}
