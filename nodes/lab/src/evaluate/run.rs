//! The run of all trials, side by side and timed.

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use crate::simulate::house::Scene;
use lattice_core::registration::{CalibrationOptions, CalibrationRequest, calibrate, track};
use nalgebra::Isometry3;

use super::initial_guess::{perturbed, seed_of};
use super::methods::{Baseline, Sources};
use super::results::{Results, name};
use super::settings::{Cell, Plan, Start};
use super::testbed::{Scenario, Testbed, View};
use super::trial::{OURS, TIMED, TRACKED, Trial, rounded};
use crate::{AnyError, pool};

/// Number of the seeds of starts.
const START: u64 = 4;
/// Error of the tracker's start, metres and degrees.
const TRACKED_OFF: (f64, f64) = (0.03, 1.0);

/// One method on one trial.
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

/// The tasks of one view.
struct Job {
    scene: Scene,
    seed: u64,
    tasks: Vec<Task>,
}

/// Runs all trials of a plan that the results do not have yet, on `threads` threads.
///
/// `progress` hears of trials done, of all, and may end the run with `Break`; what is done stays.
pub fn run(
    testbed: &Testbed,
    plan: &Plan,
    results: &mut Results,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<(), AnyError> {
    let done = results.done();
    let jobs = jobs(plan, &done, false);
    let timed = self::jobs(plan, &done, true);
    let tasks = |jobs: &[Job]| jobs.iter().map(|job| job.tasks.len()).sum::<usize>();
    let total = tasks(&jobs) + tasks(&timed);
    let mut count = 0;
    let mut keep = |trial: Trial| -> Result<ControlFlow<()>, AnyError> {
        results.add(trial)?;
        count += 1;
        Ok(progress(count, total))
    };
    if side_by_side(testbed, &jobs, threads, &mut keep)?.is_break() {
        return Err("ended before all trials were done".into());
    }
    // Nothing else runs while times are taken.
    let pool = pool(threads)?;
    for job in &timed {
        let mut trials = Vec::new();
        // The callback never breaks.
        let _ = pool.install(|| {
            run_job(testbed, job, &mut |trial| {
                trials.push(trial);
                ControlFlow::Continue(())
            })
        })?;
        for trial in trials {
            if keep(trial)?.is_break() {
                return Err("ended before all trials were done".into());
            }
        }
    }
    Ok(())
}

/// Each job on one thread, several jobs at once.
fn side_by_side(
    testbed: &Testbed,
    jobs: &[Job],
    threads: usize,
    keep: &mut dyn FnMut(Trial) -> Result<ControlFlow<()>, AnyError>,
) -> Result<ControlFlow<()>, AnyError> {
    let (next, ended) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel::<Result<Trial, AnyError>>();
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            let (sender, next, ended) = (sender.clone(), &next, &ended);
            scope.spawn(move || {
                let worked =
                    pool(1).and_then(|pool| {
                        pool.install(|| {
                            work(testbed, jobs, next, &mut |trial| match ended
                                .load(Ordering::Relaxed)
                                || sender.send(Ok(trial)).is_err()
                            {
                                true => ControlFlow::Break(()),
                                false => ControlFlow::Continue(()),
                            })
                        })
                    });
                if let Err(fault) = worked {
                    // The receiver is gone only after another error.
                    let _ = sender.send(Err(fault));
                }
            });
        }
        drop(sender);
        for trial in receiver {
            let kept = trial.and_then(&mut *keep);
            if !matches!(kept, Ok(ControlFlow::Continue(()))) {
                ended.store(true, Ordering::Relaxed);
                return kept;
            }
        }
        Ok(ControlFlow::Continue(()))
    })
}

/// Takes one job after the other.
fn work(
    testbed: &Testbed,
    jobs: &[Job],
    next: &AtomicUsize,
    found: &mut dyn FnMut(Trial) -> ControlFlow<()>,
) -> Result<(), AnyError> {
    while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
        if run_job(testbed, job, found)?.is_break() {
            break;
        }
    }
    Ok(())
}

/// The jobs of a plan that are not done; `timed` for those that are measured alone.
fn jobs(plan: &Plan, done: &HashSet<String>, timed: bool) -> Vec<Job> {
    let views = plan.views().into_iter();
    let job = |(seed, scene)| Job {
        scene,
        seed,
        tasks: match timed {
            true => timed_tasks(plan, scene, seed),
            false => tasks(plan, scene, seed),
        }
        .into_iter()
        .filter(|task| plan.wants(task.method.name()))
        .filter(|task| !done.contains(&name(&task.cell, task.method.name())))
        .collect(),
    };
    views.map(job).filter(|job| !job.tasks.is_empty()).collect()
}

fn cell(scene: Scene, seed: u64, q: f64, start: Start) -> Cell {
    Cell {
        scene: scene.name().to_owned(),
        seed,
        q,
        start: start.to_string(),
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
            let task = |method| Task {
                cell: cell(scene, seed, q, start),
                start,
                method,
            };
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
    let task = |(method, start)| Task {
        cell: cell(scene, seed, q, start),
        start,
        method,
    };
    pairs.map(task).into()
}

fn run_job(
    testbed: &Testbed,
    job: &Job,
    found: &mut dyn FnMut(Trial) -> ControlFlow<()>,
) -> Result<ControlFlow<()>, AnyError> {
    let view: View = testbed.view(job.scene, job.seed)?;
    let mut scenario: Option<(f64, Scenario)> = None;
    for task in &job.tasks {
        let q = task.cell.q;
        if scenario.as_ref().is_none_or(|(of, _)| *of != q) {
            // Before the next one is made, which is as large.
            drop(scenario.take());
            scenario = Some((q, testbed.scenario(&view, q)?));
        }
        if let Some((_, scenario)) = &scenario {
            let trial = run_task(scenario, task, job);
            if found(trial).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
    }
    Ok(ControlFlow::Continue(()))
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
            let start = start.unwrap_or_default();
            let sources = Sources {
                thinned: &scenario.source,
                full: &scenario.full,
            };
            let pose = baseline.run(&sources, scenario.map.cloud(), &start);
            trial(&pose, ms(started))
        }
        TaskMethod::Ours | TaskMethod::Timed => {
            let request = CalibrationRequest {
                headset_scans: &scenario.headset_scans,
                start,
                confusion: None,
            };
            let calibration = calibrate(&scenario.map, &request, &options, &());
            let wall_ms = ms(started);
            trial(&calibration.map_from_headset, wall_ms)
                .with_judgement(&calibration, &scenario.truth)
        }
        TaskMethod::Tracked => {
            let start = start.unwrap_or_default();
            let update = (scenario.headset_scans.first())
                .map(|headset_scan| track(&scenario.map, headset_scan, &start, &options));
            let wall_ms = ms(started);
            trial(&update.map_or(start, |u| u.map_from_headset), wall_ms)
        }
    }
}
