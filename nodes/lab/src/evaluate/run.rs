//! The run of all trials, side by side and timed.

use super::files::write_look;
use super::global_registration::register;
use super::initial_guess::perturbed;
use super::methods::Baseline;
use super::results::{Results, name};
use super::runner::{Found, run_jobs};
use super::settings::{Cell, Plan, Start, check_seeds};
use super::testbed::{Scenario, Testbed};
use super::trial::{OURS, TIMED, TRACKED, Trial, rounded};
use crate::random::seed_of;
use crate::simulate::house::Scene;
use crate::{AnyError, pool};
use lattice_core::registration::{CalibrationOptions, track};
use nalgebra::Isometry3;
use std::collections::HashSet;
use std::path::Path;
use std::time::Instant;

/// Number of the seeds of starts.
const START: u64 = 4;
/// Error of the tracker's start, metres and degrees.
const TRACKED_OFF: (f64, f64) = (0.03, 1.0);

struct Task {
    cell: Cell,
    start: Start,
    method: TaskMethod,
}

#[derive(Clone, Copy)]
enum TaskMethod {
    Baseline(Baseline),
    Ours,
    Timed,
    Tracked,
}

impl TaskMethod {
    fn name(self) -> &'static str {
        match self {
            TaskMethod::Baseline(baseline) => baseline.name(),
            TaskMethod::Ours => OURS,
            TaskMethod::Timed => TIMED,
            TaskMethod::Tracked => TRACKED,
        }
    }
}

struct Job {
    scene: Scene,
    seed: u64,
    tasks: Vec<Task>,
}

/// Runs all trials of a plan that the results do not have yet, on `threads` threads.
///
/// `progress` is called with the number of trials done, and of all.
pub fn run(
    testbed: &Testbed,
    plan: &Plan,
    results: &mut Results,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(), AnyError> {
    check_seeds(plan.seeds)?;
    let done = results.done();
    let [jobs, timed] = [false, true].map(|timed| jobs(plan, &done, timed));
    let total = jobs.iter().chain(&timed).map(|job| job.tasks.len()).sum();
    let mut count = 0;
    let mut keep = |trial: Trial| -> Result<(), AnyError> {
        results.add(trial)?;
        count += 1;
        progress(count, total);
        Ok(())
    };
    let pools = (0..threads.max(1)).map(|_| pool(1));
    let pools = pools.collect::<Result<Vec<_>, _>>()?;
    let work = |job: &Job, found: &mut Found<Trial>| run_job(testbed, job, None, found);
    run_jobs(&jobs, pools.len(), &pools, work, &mut keep)?;
    // Nothing else runs while times are taken, not even the keeping of trials.
    let looks = plan.looks.as_deref();
    let work = |job: &Job, found: &mut Found<Vec<Trial>>| {
        let mut trials = Vec::new();
        run_job(testbed, job, looks, &mut |trial| {
            trials.push(trial);
            Ok(())
        })?;
        found(trials)
    };
    let mut keep = |trials: Vec<Trial>| trials.into_iter().try_for_each(&mut keep);
    run_jobs(&timed, 1, &[pool(threads)?], work, &mut keep)
}

/// The jobs of a plan that are not done; `timed` for those that are measured alone.
fn jobs(plan: &Plan, done: &HashSet<String>, timed: bool) -> Vec<Job> {
    let job = |(seed, scene)| {
        let mut tasks = match timed {
            true => timed_tasks(plan, scene, seed),
            false => tasks(plan, scene, seed),
        };
        tasks.retain(|Task { cell, method, .. }| {
            plan.wants(method.name()) && !done.contains(&name(cell, method.name()))
        });
        (!tasks.is_empty()).then_some(Job { scene, seed, tasks })
    };
    plan.views().into_iter().filter_map(job).collect()
}

impl Task {
    fn new(scene: Scene, seed: u64, q: f64, start: Start, method: TaskMethod) -> Task {
        let cell = Cell {
            scene: scene.name().to_owned(),
            seed,
            q,
            start: start.to_string(),
        };
        Task {
            cell,
            start,
            method,
        }
    }
}

fn tasks(plan: &Plan, scene: Scene, seed: u64) -> Vec<Task> {
    let mut all = Vec::new();
    for &q in &plan.flips {
        for &start in &plan.starts {
            let mut methods = vec![TaskMethod::Ours];
            if start != Start::None {
                methods.extend(Baseline::all().map(TaskMethod::Baseline));
            }
            let task = |method| Task::new(scene, seed, q, start, method);
            all.extend(methods.into_iter().map(task));
        }
    }
    all
}

/// Timed tasks: without a start and by the tracker, at the middle share of wrong labels.
fn timed_tasks(plan: &Plan, scene: Scene, seed: u64) -> Vec<Task> {
    let q = plan.flips.get(plan.flips.len() / 2).copied();
    let Some(q) = q.filter(|_| seed.wrapping_sub(plan.first_seed) < plan.timed_seeds) else {
        return Vec::new();
    };
    let tracked = Start::Off {
        m: TRACKED_OFF.0,
        deg: TRACKED_OFF.1,
    };
    let pairs = [
        (TaskMethod::Timed, Start::None),
        (TaskMethod::Tracked, tracked),
    ];
    let task = |(method, start)| Task::new(scene, seed, q, start, method);
    pairs.map(task).into()
}

fn run_job(
    testbed: &Testbed,
    job: &Job,
    looks: Option<&Path>,
    found: &mut Found<Trial>,
) -> Result<(), AnyError> {
    let view = testbed.view(job.scene, job.seed)?;
    for tasks in job.tasks.chunk_by(|a, b| a.cell.q == b.cell.q) {
        let q = tasks.first().map_or(0.0, |task| task.cell.q);
        let scenario = testbed.scenario(&view, q)?;
        if let Some((folder, task)) = looks.zip(tasks.first()) {
            write_look(folder, &task.cell, &scenario)?;
        }
        for task in tasks {
            found(run_task(&scenario, task, job))?;
        }
    }
    Ok(())
}

fn run_task(scenario: &Scenario, task: &Task, job: &Job) -> Trial {
    let start = match task.start {
        Start::None => None,
        Start::Off { m, deg } => {
            // The same for every q.
            let seed = seed_of(&[START, job.seed, job.scene as u64, m.to_bits()]);
            Some(perturbed(&scenario.truth, &scenario.pivot_m, m, deg, seed))
        }
    };
    let trial = |pose: &Isometry3<f64>, wall_ms| Trial {
        different_share: rounded(scenario.different_share),
        ..Trial::of_pose(
            &task.cell,
            task.method.name(),
            pose,
            &scenario.truth,
            scenario.source.points_m(),
            wall_ms,
        )
    };
    let options = CalibrationOptions::default();
    let started = Instant::now();
    let ms = |started: Instant| started.elapsed().as_secs_f64() * 1e3;
    match task.method {
        TaskMethod::Baseline(baseline) => {
            let pose = baseline.run(scenario, &start.unwrap_or_default());
            trial(&pose, ms(started))
        }
        TaskMethod::Ours | TaskMethod::Timed => {
            let calibration = register(&scenario.map, &scenario.headset_scans, start, &options);
            let wall_ms = ms(started);
            trial(&calibration.target_from_source, wall_ms)
                .with_judgement(&calibration, &scenario.truth)
        }
        TaskMethod::Tracked => {
            let start = start.unwrap_or_default();
            let scan = scenario.headset_scans.first();
            let update = scan.map(|scan| track(&scenario.map, scan, &start, &options));
            let wall_ms = ms(started);
            trial(&update.map_or(start, |u| u.target_from_source), wall_ms)
        }
    }
}
