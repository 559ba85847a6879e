//! The logs that Table I is made of.

use super::placed::{POINTS, VOLUME_M3};
use crate::simulate::{Survey, SurveyPattern};
use crate::{AnyError, at};
use lattice_bag::BagReader;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::RunReport;
use lattice_nodes::replay::{self, Pipeline, Slice, TopicWishes};
use std::path::Path;

/// Length of the simulated log, s: that of `lattice simulate bobcat`. The paper does not say how long
/// its own is.
pub const SPAN_S: f64 = 30.0;

/// The log's points in the map as a mapper gets them, thinned evenly.
pub fn simulated_log(seed: u64) -> Result<Vec<[f32; 3]>, AnyError> {
    let pattern = SurveyPattern::Lms200;
    let survey = Survey::new(seed, pattern)?;
    let scans = (SPAN_S * pattern.scans_per_s()) as usize;
    let points = survey.scans().take(scans).flat_map(|scan| scan.points);
    let points: Vec<[f32; 3]> = points.map(|[x, y, z, _]| [x, y, z]).collect();
    if points.len() < POINTS {
        return Err(format!("only {} points in {SPAN_S} s of the log", points.len()).into());
    }
    let at = |i: usize| points.get(i * points.len() / POINTS).copied();
    Ok((0..POINTS).filter_map(at).collect())
}

/// A whole log through the transformer and a mapper for each lattice.
pub fn replayed(path: &Path, progress: &mut dyn FnMut(f64)) -> Result<RunReport, AnyError> {
    let bag = BagReader::open(path).map_err(at(path))?;
    let plan = replay::plan(&bag, &TopicWishes::default()).map_err(at(path))?;
    let map = |kind| Ok(MapperOptions::new(Lattice::new(kind, VOLUME_M3)?));
    let maps: Result<Vec<_>, AnyError> = LatticeKind::ALL.into_iter().map(map).collect();
    let transformer = TransformerOptions::new(plan.source);
    let mut pipeline = Pipeline::new(transformer, maps?, None)?;
    let run = replay::run(&bag, &plan, &Slice::WHOLE, &mut pipeline, "", progress);
    run.map_err(at(path))
}
