//! Result of the registration of a scan.

use nalgebra::{Isometry3, Matrix6};

use super::verdict::Verdict;

/// Result for a scan.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ScanResult {
    /// Time of the first point, ns.
    pub first_ns: i64,
    /// Pose of the base at that time.
    pub odom_from_first: Isometry3<f64>,
    /// Time of the last point, ns.
    pub end_ns: i64,
    /// Pose of the base at that time.
    pub odom_from_base: Isometry3<f64>,
    /// Covariance of a perturbation (translation, rotation) in the axes of `odom` about the base since the beginning of
    /// the submap, m^2, m rad and rad^2.
    pub covariance: Matrix6<f64>,
    /// Part of the covariance that grows along the path: that of the pose of the map around the base.
    pub drift: Matrix6<f64>,
    /// Verdict on the pose.
    pub verdict: Verdict,
    /// Number of the submap, from 0. The relative pose of two submaps is unknown.
    pub submap: u32,
    /// Inlier fraction of the registered points.
    pub overlap: f64,
    /// Number of registered points.
    pub points: usize,
    /// Contrast of the weakest direction: standard deviations by which the map explains the scan better at its pose
    /// than a cell size away.
    pub contrast: f64,
}

impl ScanResult {
    /// Result with the pose at the time of the first point.
    pub fn at_first(&self) -> ScanResult {
        ScanResult {
            end_ns: self.first_ns,
            odom_from_base: self.odom_from_first,
            ..self.clone()
        }
    }
}
