//! Table 1 and the conclusions of the paper, on many simulated trials in place of one real one.

mod claim;
mod figures;
mod table1;

use super::Context;
use super::label_maps::BAD;
use crate::AnyError;
use crate::evaluate::{
    LEAST_FOR_INTERVAL, OURS, Plan, Results, Start, Trial, WRONG, distinct, median,
    median_interval, run,
};
use crate::report::{Cell, Section, numbers};
use crate::simulate::house::Scene;
use std::collections::BTreeMap;

/// Name of GICP-SE(3) in evaluations.
const GICP: &str = "gicp_se3";
/// Forms of Semantic-ICP: as published in 2018, class by class as published in 2017, and those pairs under the
/// loss that the paper prints.
const SEMANTIC: [&str; 3] = ["semantic_hard", "class_wise", "class_wise_cauchy"];
/// A good start and a bad one.
const STARTS: [Start; 2] = [
    Start::Off { m: 0.3, deg: 10.0 },
    Start::Off { m: 0.8, deg: 35.0 },
];
/// Shares of wrong labels with which all methods are run, and one more for those that are fast.
const FLIPS: [f64; 2] = [0.0, BAD];
const BETWEEN: f64 = 0.3;
/// Trials of each cell.
const SEEDS: u64 = 15;
const QUICK_SEEDS: u64 = 1;

/// All methods in the order of the tables.
fn methods() -> [&'static str; 5] {
    let [a, b, c] = SEMANTIC;
    [GICP, a, b, c, OURS]
}

/// Trials of all methods from two starts.
struct Trials {
    all: Vec<Trial>,
    /// A good start and a bad one, as they are written.
    starts: [String; 2],
    /// The share of wrong labels that is taken for bad.
    bad: f64,
}

impl Trials {
    /// Runs the trials; `progress` gets the share done.
    fn run(context: &Context, progress: &mut dyn FnMut(f64)) -> Result<Trials, AnyError> {
        let [fast @ .., _ours] = &methods();
        let names = |methods: &[&str]| methods.iter().map(|name| (*name).to_owned()).collect();
        let plan = Plan {
            scenes: Scene::ALL.to_vec(),
            first_seed: context.first_seed,
            seeds: if context.quick { QUICK_SEEDS } else { SEEDS },
            flips: FLIPS.to_vec(),
            starts: STARTS.to_vec(),
            methods: names(&methods()),
            timed_seeds: 0,
            looks: None,
        };
        let between = Plan {
            flips: vec![BETWEEN],
            methods: names(fast),
            ..plan.clone()
        };
        // Ours takes most of the time.
        let parts: &[(&Plan, [f64; 2])] = match context.quick {
            true => &[(&plan, [0.0, 1.0])],
            false => &[(&plan, [0.0, 0.8]), (&between, [0.8, 1.0])],
        };
        let mut results = Results::in_memory();
        for (plan, [from, to]) in parts {
            let mut tell = |done: usize, all: usize| {
                progress(from + (to - from) * done as f64 / all.max(1) as f64);
            };
            let Context {
                testbed, threads, ..
            } = context;
            run(testbed, plan, &mut results, *threads, &mut tell)?;
        }
        Trials::of(results.sorted())
    }

    /// Trials of an evaluation: the nearest start and the farthest, and the share of wrong labels nearest to
    /// [`BAD`].
    fn of(all: Vec<Trial>) -> Result<Trials, AnyError> {
        let off = |trial: &Trial| match trial.cell.start.parse() {
            Ok(Start::Off { m, .. }) => Some((m, trial.cell.start.clone())),
            _ => None,
        };
        let mut starts: Vec<(f64, String)> = all.iter().filter_map(off).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.dedup();
        let mut flips: Vec<f64> = all.iter().map(|t| t.cell.q).filter(|q| *q > 0.0).collect();
        flips.sort_by(|a, b| (a - BAD).abs().total_cmp(&(b - BAD).abs()));
        let labelled_right = all.iter().any(|trial| trial.cell.q == 0.0);
        match (starts.as_slice(), flips.first()) {
            ([(_, good), .., (_, poor)], Some(bad)) if labelled_right => Ok(Trials {
                starts: [good.clone(), poor.clone()],
                bad: *bad,
                all,
            }),
            _ => Err("the results lack two starts that are off, or right and wrong labels".into()),
        }
    }

    /// Trials of one method; of all scenes if `None`.
    fn of_method(
        &self,
        scene: Option<Scene>,
        q: f64,
        start: &str,
        method: &str,
    ) -> impl Iterator<Item = &Trial> {
        self.all.iter().filter(move |trial| {
            let cell = &trial.cell;
            trial.method == method
                && cell.q == q
                && cell.start == start
                && scene.is_none_or(|scene| cell.scene == scene.name())
        })
    }

    /// The median d_SE(3) of a method, if there are trials.
    fn d_se3(&self, scene: Option<Scene>, q: f64, start: &str, method: &str) -> Option<Median> {
        let trials = self.of_method(scene, q, start, method);
        Median::of(trials.map(|trial| trial.d_se3))
    }

    /// The d_SE(3) of a method as a multiple of that of GICP-SE(3) in the same trial.
    fn ratio(&self, scene: Option<Scene>, q: f64, start: &str, method: &str) -> Option<Median> {
        let theirs = self.of_method(scene, q, start, GICP);
        let theirs: BTreeMap<_, f64> = theirs.map(|t| (t.cell.key(), t.d_se3)).collect();
        let ratios = self.of_method(scene, q, start, method).filter_map(|trial| {
            let theirs = theirs.get(&trial.cell.key())?;
            // Trials keep six digits; no error is nothing.
            Some(trial.d_se3.max(1e-6) / theirs.max(1e-6))
        });
        Median::of(ratios)
    }

    /// Shares of wrong labels of which there are trials.
    fn flips(&self) -> Vec<f64> {
        distinct(self.all.iter().map(|trial| trial.cell.q))
    }
}

/// A median with its 95 % interval.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Median {
    n: usize,
    value: f64,
    /// None of too few values.
    interval: Option<[f64; 2]>,
}

impl Median {
    fn of(values: impl Iterator<Item = f64>) -> Option<Median> {
        let values: Vec<f64> = values.collect();
        let interval = median_interval(values.iter().copied());
        Some(Median {
            n: values.len(),
            interval: interval.filter(|_| values.len() >= LEAST_FOR_INTERVAL),
            value: median(values)?,
        })
    }

    /// Ends of the interval as cells.
    fn ends(&self, digits: usize) -> [Cell; 2] {
        let ends = self.interval.map(|ends| numbers(digits, ends));
        ends.unwrap_or([Cell::Empty, Cell::Empty])
    }

    /// "0.06 [0.05, 0.08]".
    fn text(&self) -> String {
        match self.interval {
            Some(ends) => {
                let [low, high] = ends.map(short);
                format!("{} [{low}, {high}]", short(self.value))
            }
            None => short(self.value),
        }
    }
}

/// Two digits that count, no more than three after the point.
fn short(value: f64) -> String {
    match value.abs() {
        size if size >= 10.0 => format!("{value:.0}"),
        size if size >= 1.0 => format!("{value:.1}"),
        size if size >= 0.1 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// "0.3/10" in words.
fn in_words(start: &str) -> String {
    match start.split_once('/') {
        Some((m, deg)) => format!("{m} m and {deg} degrees off"),
        None => start.to_owned(),
    }
}

/// The sections of Table 1 and of what is concluded.
pub(super) fn sections(
    context: &Context,
    evaluated: Option<Vec<Trial>>,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Section>, AnyError> {
    let trials = match evaluated {
        Some(trials) => Trials::of(trials)?,
        None => Trials::run(context, progress)?,
    };
    Ok(vec![table1::section(&trials)?, claim::section(&trials)?])
}

/// Share of the trials that are right.
fn right(trials: impl Iterator<Item = impl std::borrow::Borrow<Trial>>) -> crate::evaluate::Share {
    crate::evaluate::Share::of(trials.map(|trial| trial.borrow().is_within(WRONG)))
}

#[cfg(test)]
mod tests;
