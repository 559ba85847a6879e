//! Trials that have nothing in common but how they are run and kept.

use std::ops::Range;

use super::results::name;
use super::runner::{Found, run_jobs};
use super::settings::{Cell, Settings, check_seeds};
use super::trial::{OURS, Trial};
use super::{Results, Start};
use crate::{AnyError, pool};

/// A case of an evaluation: all that a trial depends on but its seed.
pub trait Case: Sync {
    /// Name of the scene, by which reports sort.
    fn name(&self) -> String;

    /// Runs the trial of a cell.
    fn run(&self, cell: &Cell) -> Result<Trial, AnyError>;

    /// The cell of a seed: all labels as they are, and no start.
    fn cell(&self, seed: u64) -> Cell {
        Cell {
            scene: self.name(),
            seed,
            q: 0.0,
            start: Start::None.to_string(),
        }
    }
}

/// Settings that results of cases are kept with, given the side of the cells of the maps.
pub fn settings_of(cell_side_m: f64) -> Settings {
    Settings {
        cell_side_m,
        survey_views: 0,
        map_seeds: 0,
        ..Settings::default()
    }
}

/// Runs the trials of the cases whose names contain `part`, with each of `seeds`, that the results do not have
/// yet, seed by seed, on `threads` threads.
///
/// `progress` is called with the number of trials done, and of all that are left.
///
/// # Errors
/// If no case has such a name, or a trial or its result fails.
pub fn run_cases<C: Case>(
    cases: &[C],
    seeds: Range<u64>,
    part: &str,
    results: &mut Results,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(), AnyError> {
    check_seeds(seeds.end.saturating_sub(seeds.start))?;
    let done = results.done();
    let cases = cases.iter().filter(|case| case.name().contains(part));
    let cases: Vec<&C> = cases.collect();
    if cases.is_empty() {
        return Err(format!("no case has {part:?} in its name").into());
    }
    let trials = seeds.flat_map(|seed| cases.iter().map(move |case| (case.cell(seed), *case)));
    let left = trials.filter(|(cell, _)| !done.contains(&name(cell, OURS)));
    let left: Vec<(Cell, &C)> = left.collect();
    let work = |(cell, case): &(Cell, &C), found: &mut Found<Trial>| found(case.run(cell)?);
    let mut count = 0;
    let mut keep = |trial| {
        results.add(trial)?;
        count += 1;
        progress(count, left.len());
        Ok(())
    };
    run_jobs(&left, threads.max(1), &[pool(threads)?], work, &mut keep)
}
