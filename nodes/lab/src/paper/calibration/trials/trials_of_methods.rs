//! Trials of all methods from two starts.

use super::median::Median;
use super::methods::{GICP, methods};
use crate::AnyError;
use crate::evaluate::{Plan, Results, Share, Start, Trial, WRONG, distinct, run};
use crate::paper::calibration::context::Context;
use crate::paper::calibration::label_maps::BAD;
use crate::simulate::house::Scene;
use std::borrow::Borrow;
use std::collections::BTreeMap;

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

/// Trials of all methods from two starts.
pub struct Trials {
    pub all: Vec<Trial>,
    /// A good start and a bad one, as they are written.
    pub starts: [String; 2],
    /// The share of wrong labels that is taken for bad.
    pub bad: f64,
}

impl Trials {
    /// Runs the trials; `progress` gets the share done.
    pub fn run(context: &Context, progress: &mut dyn FnMut(f64)) -> Result<Trials, AnyError> {
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
    pub fn of(all: Vec<Trial>) -> Result<Trials, AnyError> {
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
    pub fn of_method(
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
    pub fn d_se3(&self, scene: Option<Scene>, q: f64, start: &str, method: &str) -> Option<Median> {
        let trials = self.of_method(scene, q, start, method);
        Median::of(trials.map(|trial| trial.d_se3))
    }

    /// The d_SE(3) of a method as a multiple of that of GICP-SE(3) in the same trial.
    pub fn ratio(&self, scene: Option<Scene>, q: f64, start: &str, method: &str) -> Option<Median> {
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
    pub fn flips(&self) -> Vec<f64> {
        distinct(self.all.iter().map(|trial| trial.cell.q))
    }
}

/// "0.3/10" in words.
pub fn in_words(start: &str) -> String {
    match start.split_once('/') {
        Some((m, deg)) => format!("{m} m and {deg} degrees off"),
        None => start.to_owned(),
    }
}

/// Share of the trials that are right.
pub fn right(trials: impl Iterator<Item = impl Borrow<Trial>>) -> Share {
    Share::of(trials.map(|trial| trial.borrow().is_within(WRONG)))
}
