//! The summary of all trials. Nothing is left out: a pose that was refused counts as it is.

mod tables;

use super::settings::Settings;
use super::statistics::{Share, distinct, mean, median, quantile};
use super::trial::{OURS, TIMED, TRACKED, Trial, WRONG, WRONG_TIGHT};
use serde::Serialize;
use std::collections::BTreeMap;
pub use tables::{Accepted, Consistency, PRINTED, Paired, Printed, Row, TimeRow};

/// Tolerance of "not worse": metres and degrees.
const TOLERANCE: (f64, f64) = (0.01, 0.2);

/// All tables of an evaluation.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Summary {
    pub(super) settings: Settings,
    /// Threads of timed trials; the others had one.
    pub(super) timed_threads: usize,
    pub(super) trials: usize,
    pub(super) printed: [Printed; 4],
    /// Rows by scene, start, share of wrong labels and method; and over all scenes.
    pub(super) rows: Vec<Row>,
    /// Ours against the others, trial by trial.
    pub(super) paired: Vec<Paired>,
    pub(super) accepted: Vec<Accepted>,
    pub(super) consistency: Vec<Consistency>,
    pub(super) times: Vec<TimeRow>,
    /// Trials of ours that were refused, or accepted and wrong.
    pub(super) failures: Vec<Trial>,
}

/// Distinct names in their order, and "all".
fn with_all<'a>(trials: &[&'a Trial], of: impl Fn(&'a Trial) -> &'a str) -> Vec<&'a str> {
    let mut names = sorted(trials.iter().map(|t| of(t)));
    names.push("all");
    names
}

fn flips_and_all(trials: &[&Trial]) -> Vec<Option<f64>> {
    let flips = distinct(trials.iter().map(|t| t.cell.q)).into_iter();
    flips.map(Some).chain([None]).collect()
}

fn is_of(name: &str, wanted: &str) -> bool {
    wanted == "all" || name == wanted
}

impl Summary {
    /// A summary of trials in the order of [`Results::sorted`](super::Results::sorted).
    pub fn new(settings: &Settings, trials: &[Trial], timed_threads: usize) -> Summary {
        let (timed, plain): (Vec<&Trial>, Vec<&Trial>) =
            (trials.iter()).partition(|t| [TIMED, TRACKED].contains(&t.method.as_str()));
        let ours: Vec<&Trial> = plain.iter().copied().filter(|t| t.method == OURS).collect();
        let refused = |t: &&&Trial| !t.is_accepted() || !t.is_within(WRONG);
        Summary {
            settings: settings.clone(),
            timed_threads,
            trials: trials.len(),
            printed: PRINTED,
            rows: rows(&plain),
            paired: paired(&plain, &ours),
            accepted: accepted(&ours),
            consistency: consistency(&ours),
            times: times(&plain, &timed),
            failures: ours.iter().filter(refused).map(|t| (**t).clone()).collect(),
        }
    }

    pub(super) fn starts(&self) -> Vec<&str> {
        sorted(self.rows.iter().map(|row| row.start.as_str()))
    }

    pub(super) fn flips(&self) -> Vec<f64> {
        distinct(self.rows.iter().map(|row| row.q))
    }

    /// Distinct scenes, in order, without all of them together.
    pub(super) fn scenes(&self) -> Vec<&str> {
        let scenes = self.rows.iter().map(|row| row.scene.as_str());
        sorted(scenes.filter(|scene| *scene != "all"))
    }

    /// Rows of a scene, start and method, in the order of their shares of wrong labels.
    pub(super) fn of_method(&self, scene: &str, start: &str, method: &str) -> Vec<&Row> {
        let of = |r: &&Row| r.scene == scene && r.start == start && r.method == method;
        let mut rows: Vec<&Row> = self.rows.iter().filter(of).collect();
        rows.sort_by(|a, b| a.q.total_cmp(&b.q));
        rows
    }
}

pub(super) fn sorted<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    names.dedup();
    names
}

fn rows(trials: &[&Trial]) -> Vec<Row> {
    let mut cells: BTreeMap<(String, String, u64, String), Vec<&Trial>> = BTreeMap::new();
    for trial in trials {
        for scene in [trial.cell.scene.as_str(), "all"] {
            // Shares are not negative, so that their bits are in their order.
            let (start, q) = (trial.cell.start.clone(), trial.cell.q.to_bits());
            let key = (scene.to_owned(), start, q, trial.method.clone());
            cells.entry(key).or_default().push(trial);
        }
    }
    let row = |((scene, start, q, method), trials): (_, Vec<&Trial>)| {
        let median_of = |of: fn(&Trial) -> f64| median(trials.iter().map(|t| of(t)));
        Row {
            scene,
            start,
            q: f64::from_bits(q),
            method,
            success: Share::of(trials.iter().map(|t| t.is_within(WRONG))),
            d_se3: median_of(|t| t.d_se3),
            d_se3_left: median_of(|t| t.d_se3_left),
            translation_m: median_of(|t| t.translation_m),
            rotation_deg: median_of(|t| t.rotation_deg),
            view_m: median_of(|t| t.view_m),
        }
    };
    cells.into_iter().map(row).collect()
}

fn paired(trials: &[&Trial], ours: &[&Trial]) -> Vec<Paired> {
    let mine: BTreeMap<_, &Trial> = ours.iter().map(|t| (t.cell.key(), *t)).collect();
    let others = sorted(trials.iter().map(|t| t.method.as_str()));
    let mut table = Vec::new();
    for against in others.into_iter().filter(|method| *method != OURS) {
        let of_method = trials.iter().filter(|t| t.method == against);
        let pairs: Vec<(&Trial, &Trial)> = of_method
            .filter_map(|other| Some((*mine.get(&other.cell.key())?, *other)))
            .collect();
        let others: Vec<&Trial> = pairs.iter().map(|(_, other)| *other).collect();
        for start in with_all(&others, |t| &t.cell.start) {
            for q in flips_and_all(&others) {
                let wanted = |(_, t): &&(&Trial, &Trial)| {
                    is_of(&t.cell.start, start) && q.is_none_or(|q| q == t.cell.q)
                };
                let cell: Vec<_> = pairs.iter().filter(wanted).copied().collect();
                table.push(compare(against, start, q, &cell));
            }
        }
    }
    table
}

fn compare(against: &str, start: &str, q: Option<f64>, pairs: &[(&Trial, &Trial)]) -> Paired {
    let not_worse = |(a, b): &(&Trial, &Trial)| {
        a.translation_m <= b.translation_m + TOLERANCE.0
            && a.rotation_deg <= b.rotation_deg + TOLERANCE.1
    };
    let in_view = |(a, b): &(&Trial, &Trial)| a.view_m <= b.view_m + TOLERANCE.0;
    let saved = |(a, b): &(&Trial, &Trial)| a.is_within(WRONG) && !b.is_within(WRONG);
    let spoiled = |(a, b): &(&Trial, &Trial)| !a.is_within(WRONG) && b.is_within(WRONG);
    Paired {
        against: against.to_owned(),
        start: start.to_owned(),
        q,
        not_worse: Share::of(pairs.iter().map(not_worse)),
        not_worse_or_saved: Share::of(pairs.iter().map(|p| not_worse(p) || saved(p))),
        not_worse_in_view: Share::of(pairs.iter().map(in_view)),
        saved: Share::of(pairs.iter().map(saved)),
        spoiled: Share::of(pairs.iter().map(spoiled)),
    }
}

fn accepted(ours: &[&Trial]) -> Vec<Accepted> {
    let mut table = Vec::new();
    for start in sorted(ours.iter().map(|t| t.cell.start.as_str())) {
        let of_start = ours.iter().filter(|t| t.cell.start == start);
        let of_start: Vec<&Trial> = of_start.copied().collect();
        for scene in with_all(&of_start, |t| &t.cell.scene) {
            for q in flips_and_all(&of_start) {
                let wanted =
                    |t: &&&Trial| is_of(&t.cell.scene, scene) && q.is_none_or(|q| q == t.cell.q);
                let cell: Vec<&Trial> = of_start.iter().filter(wanted).copied().collect();
                let taken = cell.iter().filter(|t| t.is_accepted());
                let taken: Vec<&&Trial> = taken.collect();
                let mut verdicts = BTreeMap::new();
                for judged in cell.iter().filter_map(|t| t.judged.as_ref()) {
                    *verdicts.entry(judged.verdict.clone()).or_insert(0) += 1;
                }
                table.push(Accepted {
                    scene: scene.to_owned(),
                    start: start.to_owned(),
                    q,
                    accepted: Share::new(taken.len(), cell.len()),
                    wrong: Share::of(taken.iter().map(|t| !t.is_within(WRONG))),
                    wrong_tight: Share::of(taken.iter().map(|t| !t.is_within(WRONG_TIGHT))),
                    wrong_in_view: Share::of(taken.iter().map(|t| !t.is_within_in_view(WRONG))),
                    right: Share::of(cell.iter().map(|t| t.is_within(WRONG))),
                    verdicts,
                });
            }
        }
    }
    table
}

fn consistency(ours: &[&Trial]) -> Vec<Consistency> {
    let taken = ours.iter().filter(|t| t.is_accepted()).copied();
    let taken: Vec<&Trial> = taken.collect();
    let of_start = |start: &str| {
        let of = taken.iter().filter(|t| is_of(&t.cell.start, start));
        let nees: Vec<f64> = of.filter_map(|t| t.judged.as_ref()?.nees).collect();
        Consistency {
            start: start.to_owned(),
            n: nees.len(),
            mean_over_6: mean(&nees).map(|nees| nees / 6.0),
            median_over_expected: median(nees).map(|nees| nees / 5.348),
        }
    };
    let starts = with_all(&taken, |t| &t.cell.start);
    starts.into_iter().map(of_start).collect()
}

fn times(plain: &[&Trial], timed: &[&Trial]) -> Vec<TimeRow> {
    let mut cells: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for trial in plain.iter().chain(timed) {
        let key = (trial.method.clone(), trial.cell.start.clone());
        cells.entry(key).or_default().push(trial.wall_ms);
    }
    let row = |((method, start), ms): (_, Vec<f64>)| TimeRow {
        method,
        start,
        n: ms.len(),
        median_ms: median(ms.iter().copied()),
        p90_ms: quantile(ms, 0.9),
    };
    cells.into_iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::settings::Cell;
    use super::*;
    use lattice_core::registration::{Calibration, Verdict};
    use nalgebra::{Isometry3, Matrix6, Vector3};

    /// Off by metres and by degrees about the vertical.
    fn trial(seed: u64, method: &str, m: f64, deg: f64, verdict: Verdict) -> Trial {
        let cell = Cell {
            scene: "tv".to_owned(),
            seed,
            q: 0.2,
            start: "0.3/10".to_owned(),
        };
        let pose = Isometry3::new(Vector3::x() * m, Vector3::z() * deg.to_radians());
        let truth = Isometry3::identity();
        let trial = Trial::of_pose(&cell, method, &pose, &truth, &[Vector3::x().into()], 10.0);
        let calibration = Calibration {
            target_from_source: pose,
            covariance: Matrix6::identity() * 1e-4,
            ..Calibration::refused(verdict, "")
        };
        match method {
            OURS => trial.with_judgement(&calibration, &truth),
            _ => trial,
        }
    }

    #[test]
    fn refused_poses_count_in_comparisons_and_not_among_the_accepted() {
        let trials = [
            trial(0, OURS, 0.02, 0.1, Verdict::Ok),
            trial(1, OURS, 0.30, 0.0, Verdict::Ok),
            trial(2, OURS, 0.02, 0.0, Verdict::Ambiguous),
            trial(3, OURS, 5.00, 90.0, Verdict::NoOverlap),
            trial(0, "gicp_se3", 0.015, 0.0, Verdict::Ok),
            trial(1, "gicp_se3", 2.0, 50.0, Verdict::Ok),
            trial(2, "gicp_se3", 0.2, 0.1, Verdict::Ok),
            trial(3, "gicp_se3", 0.02, 0.1, Verdict::Ok),
        ];
        let summary = Summary::new(&Settings::default(), &trials, 2);
        let mut paired = summary.paired.iter();
        let paired = paired.find(|p| p.start == "all" && p.q.is_none()).unwrap();
        let counts = |share: &Share| (share.k, share.n);
        assert_eq!(counts(&paired.not_worse), (3, 4));
        assert_eq!([&paired.saved, &paired.spoiled].map(counts), [(1, 4); 2]);

        let of_all = |a: &&Accepted| a.scene == "all" && a.q.is_none();
        let accepted = summary.accepted.iter().find(of_all).unwrap();
        assert_eq!(counts(&accepted.accepted), (2, 4));
        assert_eq!(counts(&accepted.wrong), (1, 2));
        assert_eq!(counts(&accepted.right), (2, 4));
        assert_eq!(summary.failures.len(), 3);

        // (0.02^2 + 0.1 deg^2) / 1e-4 and 0.3^2 / 1e-4.
        let mut both = summary.consistency.iter();
        let both = both.find(|c| c.start == "all").unwrap();
        let expected = (4.0 + 0.1_f64.to_radians().powi(2) / 1e-4 + 900.0) / 2.0 / 6.0;
        assert!((both.mean_over_6.unwrap() - expected).abs() < 1e-6);

        let [row] = summary.of_method("all", "0.3/10", OURS)[..] else {
            panic!("not one row");
        };
        assert_eq!(counts(&row.success), (2, 4));
        assert!((row.translation_m.unwrap() - 0.16).abs() < 1e-6);
        let report = super::super::report(&summary, &trials).unwrap();
        let text = crate::report::markdown(&report);
        let line = "| GICP-SE(3) | all | all | 75.0 % of 4";
        assert!(text.contains(line), "{text}");
    }

    #[test]
    fn no_trials_make_empty_tables() {
        let summary = Summary::new(&Settings::default(), &[], 2);
        assert!(summary.rows.is_empty() && summary.failures.is_empty());
        let report = super::super::report(&summary, &[]).unwrap();
        assert!(crate::report::markdown(&report).contains("0 results"));
    }
}
