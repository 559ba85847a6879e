//! A scene with right labels, and the errors of poses in it.

use crate::evaluate::Scenario;
use lattice_core::registration::PreparedCloud;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// A correspondence search reaches as far as that of the published programs, metres.
pub(super) const GATE_M: f64 = 15.811_388_300_841_896;

/// A scene with right labels, on which the equations are tried.
pub(super) struct ReferenceScene {
    pub(super) scenario: Scenario,
}

impl ReferenceScene {
    pub(super) fn source(&self) -> &PreparedCloud {
        &self.scenario.source
    }

    pub(super) fn target(&self) -> &PreparedCloud {
        self.scenario.map.cloud()
    }

    /// The truth, moved and turned about the vertical at what is seen.
    pub(super) fn off(&self, moved_m: Vector3<f64>, turned_rad: f64) -> Isometry3<f64> {
        let truth = &self.scenario.truth;
        let place = Translation3::from((truth * self.scenario.pivot_m).coords);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * turned_rad);
        Translation3::from(moved_m) * place * turn * place.inverse() * truth
    }

    /// 0.3 m and 10 degrees off.
    pub(super) fn start(&self) -> Isometry3<f64> {
        self.off(Vector3::new(0.25, -0.15, 0.05), 10.0_f64.to_radians())
    }

    /// Mean distance of the seen points from where they should be, metres.
    pub(super) fn seen_m(&self, pose: &Isometry3<f64>) -> f64 {
        let points_m = self.source().points_m();
        let apart = |p: &Point3<f64>| nalgebra::distance(&(pose * p), &(self.scenario.truth * p));
        points_m.iter().map(apart).sum::<f64>() / points_m.len().max(1) as f64
    }
}
