//! Eqs. (1) to (8): what is printed, what it should be, and whether the library computes that.

mod geometry;
mod literal;
mod semantic;

use super::Context;
use crate::AnyError;
use crate::evaluate::Scenario;
use crate::report::{Cell, Section, Table};
use crate::simulate::house::Scene;
use lattice_core::registration::PreparedCloud;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// A correspondence search reaches as far as that of the published programs, metres.
const GATE_M: f64 = 15.811_388_300_841_896;

/// A scene with right labels, on which the equations are tried.
struct Bench {
    scenario: Scenario,
}

impl Bench {
    fn source(&self) -> &PreparedCloud {
        &self.scenario.source
    }

    fn target(&self) -> &PreparedCloud {
        self.scenario.map.cloud()
    }

    /// The truth, moved and turned about the vertical at what is seen.
    fn off(&self, moved_m: Vector3<f64>, turned_rad: f64) -> Isometry3<f64> {
        let truth = &self.scenario.truth;
        let place = Translation3::from((truth * self.scenario.pivot_m).coords);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * turned_rad);
        Translation3::from(moved_m) * place * turn * place.inverse() * truth
    }

    /// 0.3 m and 10 degrees off.
    fn start(&self) -> Isometry3<f64> {
        self.off(Vector3::new(0.25, -0.15, 0.05), 10.0_f64.to_radians())
    }

    /// Mean distance of the seen points from where they should be, metres.
    fn seen_m(&self, pose: &Isometry3<f64>) -> f64 {
        let points_m = self.source().points_m();
        let apart = |p: &Point3<f64>| nalgebra::distance(&(pose * p), &(self.scenario.truth * p));
        points_m.iter().map(apart).sum::<f64>() / points_m.len().max(1) as f64
    }
}

pub(super) fn sections(
    context: &Context,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Section>, AnyError> {
    let view = context.testbed.view(Scene::Dining, context.first_seed)?;
    let bench = Bench {
        scenario: context.testbed.scenario(&view, 0.0)?,
    };
    progress(0.3);
    let geometry = geometry::section(&bench)?;
    progress(0.5);
    Ok(vec![geometry, semantic::section(context, &bench)?])
}

/// Printed, what is wrong with it, what we take.
type Slip = [&'static str; 4];

fn slips(name: &str, slips: &[Slip]) -> Table {
    Table::new(
        name,
        "What is printed, and what we take",
        "where|printed|what is wrong|what we take",
        slips.iter().map(|slip| slip.map(Cell::from).into()),
    )
}
