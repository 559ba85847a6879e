//! Competitors of the evaluations: registrations, the start itself and ours, with their colours.

use super::testbed::Scenario;
use super::trial::{OURS, TIMED, TRACKED};
use lattice_core::registration::{CalibrationMap, Method, NamedMethod, PreparedCloud, register};
use nalgebra::Isometry3;
use plotters::style::RGBColor;

/// Gate of the methods for which none is published, metres.
const GATE_M: f64 = 1.0;
pub const START: &str = "start";
pub const OURS_TITLE: &str = "ours";

/// Name, letters below a method's dots, and colour, one of those that colour-blind people distinguish (Wong 2011).
const LOOKS: [(&str, &str, RGBColor); 9] = [
    (START, "start", RGBColor(170, 170, 170)),
    ("icp", "ICP", RGBColor(86, 180, 233)),
    ("gicp", "GICP", RGBColor(0, 114, 178)),
    ("gicp_se3", "GICP", RGBColor(0, 158, 115)),
    ("semantic_hard", "S 2018", RGBColor(230, 159, 0)),
    ("semantic_soft", "S soft", RGBColor(240, 228, 66)),
    ("em_hard", "EM", RGBColor(204, 121, 167)),
    ("class_wise", "CW 2017", RGBColor(213, 94, 0)),
    ("class_wise_cauchy", "CW Cauchy", RGBColor(128, 56, 0)),
];

/// Title of a competitor in tables and keys.
pub fn title(name: &str) -> &str {
    match name {
        OURS => OURS_TITLE,
        TIMED => "ours, alone",
        TRACKED => "tracking, alone",
        _ => NamedMethod::named(name).map_or(name, |method| method.title),
    }
}

/// Letters below a competitor's dots.
pub fn letters(name: &str) -> &'static str {
    let look = LOOKS.iter().find(|look| look.0 == name);
    look.map_or(OURS_TITLE, |look| look.1)
}

/// Colour of a competitor; ours is black.
pub fn color(name: &str) -> RGBColor {
    let look = LOOKS.iter().find(|look| look.0 == name);
    look.map_or(RGBColor(0, 0, 0), |look| look.2)
}

/// All competitors in the order of the tables, ours last.
pub fn competitors() -> impl Iterator<Item = &'static str> {
    Baseline::all()
        .map(|baseline| baseline.name())
        .chain([OURS])
}

/// A registration from a start, or the start as it is.
#[derive(Clone, Copy, Debug)]
pub struct Baseline(Option<&'static NamedMethod>);

impl Baseline {
    pub fn all() -> impl Iterator<Item = Baseline> {
        let methods = NamedMethod::ALL.iter().map(Some);
        let all = std::iter::once(None).chain(methods).map(Baseline);
        all.filter(|baseline| baseline.name() != "as_printed")
    }

    pub fn name(&self) -> &'static str {
        self.0.map_or(START, |method| method.name)
    }

    /// The method with a name.
    pub fn named(name: &str) -> Option<Baseline> {
        Baseline::all().find(|baseline| baseline.name() == name)
    }

    /// The pose that it finds for a cloud in a map from a start.
    pub fn register(
        &self,
        source: &PreparedCloud,
        map: &CalibrationMap,
        start: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        let found = |method: &NamedMethod| {
            let options = method.options(GATE_M);
            register(source, map.cloud(), start, &options).target_from_source
        };
        self.0.map_or(*start, found)
    }

    /// The pose that it finds from a start.
    ///
    /// The class-wise method of 2017 gets all points: it leaves out classes of fewer than 400, which would
    /// be nearly all of the thinned ones.
    pub fn run(&self, scenario: &Scenario, start: &Isometry3<f64>) -> Isometry3<f64> {
        let class_wise = self.0.is_some_and(|method| {
            let options = method.options(GATE_M);
            matches!(options.method, Method::ClassWise) && options.kernel_of_square
        });
        let source = match class_wise {
            true => &scenario.full,
            false => &scenario.source,
        };
        self.register(source, &scenario.map, start)
    }
}
