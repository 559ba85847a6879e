//! Diagnostics of the fit of a result.

use nalgebra::Point3;

/// Maximum number of listed regions.
pub(super) const LISTED: usize = 16;

/// Fit of a cloud to a map by region.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct FitDiagnostics {
    /// Mean squared Mahalanobis shift of the regions over all constrained directions; near 1 or less if sensor noise
    /// and quantization explain the residuals.
    pub chi_square: f64,
    /// Fraction of the points in free space in front of a surface of the map; 0 if the sensor position is unknown.
    pub floating: f64,
    /// Fraction of the lines of sight that pass through a surface of the map.
    pub blocked: f64,
    /// Unexplained regions in descending order of their points; at most 16.
    pub unexplained: Vec<Unexplained>,
}

impl FitDiagnostics {
    /// Describes the unexplained regions; `None` if there are none.
    pub(super) fn describe(&self) -> Option<String> {
        let first = self.unexplained.first()?;
        let [x, y, z] = [first.place_m.x, first.place_m.y, first.place_m.z];
        let regions = match self.unexplained.len() {
            1 => "1 region is".to_owned(),
            LISTED => format!("{LISTED} regions and more are"),
            n => format!("{n} regions are"),
        };
        let kind = first.kind.name();
        Some(format!(
            "{regions} not explained by the map, the largest ({kind}) at ({x:.1}, {y:.1}, {z:.1})"
        ))
    }
}

/// Region of a cloud that the map does not explain.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Unexplained {
    /// Kind of the misfit.
    pub kind: UnexplainedKind,
    /// Centroid of its points in the map, metres.
    pub place_m: Point3<f64>,
    /// Number of its registered points.
    pub points: usize,
    /// Distance from the surfaces of the map, metres; 0 if there are none nearby.
    pub beside_m: f64,
}

/// Kind of an unexplained region.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum UnexplainedKind {
    /// The map has no surface there and none behind it.
    Missing,
    /// The map has free space there and a surface behind it: a new object or a wrong pose.
    Floating,
    /// The region is shifted from a surface of the map.
    Beside,
    /// The lines of sight pass through a surface of the map: a removed object or a wrong pose.
    Hidden,
}

impl UnexplainedKind {
    /// Name in results.
    pub fn name(self) -> &'static str {
        match self {
            UnexplainedKind::Missing => "missing",
            UnexplainedKind::Floating => "floating",
            UnexplainedKind::Beside => "beside",
            UnexplainedKind::Hidden => "hidden",
        }
    }
}
