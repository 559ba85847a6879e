//! Verdicts on made-up trials.

use super::methods::{SEMANTIC, methods};
use super::*;
use crate::evaluate::{Cell, OURS, Trial};
use crate::report::Verdict;
use crate::simulate::house::Scene;
use nalgebra::Isometry3;

/// d_SE(3) by share of wrong labels, whether the start is good, and method.
type Error = fn(f64, bool, &str) -> f64;

fn trials(seeds: u64, error: Error) -> Vec<Trial> {
    let mut all = Vec::new();
    for seed in 0..seeds {
        for scene in Scene::ALL {
            for q in [0.0, 0.2, 0.6] {
                for start in ["0.8/35", "0.3/10", "none"] {
                    for method in methods() {
                        let cell = Cell {
                            scene: scene.name().to_owned(),
                            seed,
                            q,
                            start: start.to_owned(),
                        };
                        let pose = Isometry3::identity();
                        let trial = Trial::of_pose(&cell, method, &pose, &pose, &[], 1.0);
                        // Harder scenes are so for all methods.
                        let hard = 1.0 + seed as f64 + 10.0 * f64::from(scene as u8);
                        all.push(Trial {
                            d_se3: hard * error(q, start == "0.3/10", method),
                            ..trial
                        });
                    }
                }
            }
        }
    }
    all
}

fn is_semantic(method: &str) -> bool {
    SEMANTIC.contains(&method)
}

/// Errors as the paper has them.
fn as_said(q: f64, good: bool, method: &str) -> f64 {
    match (is_semantic(method), q > 0.5, good) {
        (true, true, _) => 9.0,
        (true, false, _) => 0.05,
        (false, _, true) => 0.06,
        (false, _, false) => 5.0,
    }
}

#[test]
fn starts_and_labels_are_found_among_others() {
    let trials = Trials::of(trials(2, as_said)).unwrap();
    assert_eq!(trials.starts, ["0.3/10", "0.8/35"]);
    assert_eq!((trials.bad, trials.flips()), (0.6, vec![0.0, 0.2, 0.6]));
    let n = trials
        .of_method(Some(Scene::Tv), 0.6, "0.3/10", OURS)
        .count();
    assert_eq!(n, 2);
    let ratio = trials.ratio(None, 0.0, "0.8/35", "class_wise").unwrap();
    assert!((ratio.value - 0.01).abs() < 1e-12 && ratio.n == 8);
}

#[test]
fn results_that_cannot_be_judged_are_refused() {
    let all = trials(1, as_said);
    let only = |keep: fn(&Trial) -> bool| {
        Trials::of(all.iter().filter(|t| keep(t)).cloned().collect()).is_err()
    };
    assert!(only(|_| false));
    assert!(only(|trial| trial.cell.start != "0.3/10"));
    assert!(only(|trial| trial.cell.q > 0.0));
    assert!(only(|trial| trial.cell.q == 0.0));
}

#[test]
fn a_claim_stands_or_falls_with_the_trials() {
    let verdict = |seeds: u64, error: Error| {
        let trials = Trials::of(trials(seeds, error)).unwrap();
        claim::section(&trials).unwrap().verdict
    };
    assert_eq!(verdict(3, as_said), Verdict::Reproduced);
    // One trial of each scene is too few.
    assert!(matches!(verdict(1, as_said), Verdict::DependsOnData(_)));
    let one_fails: Error = |q, good, method| match method {
        "class_wise" => 5.0,
        _ => as_said(q, good, method),
    };
    let Verdict::Corrected(why) = verdict(3, one_fails) else {
        panic!("{:?}", verdict(3, one_fails));
    };
    assert!(why.ends_with("not for class-wise 2017"), "{why}");
    let never_better: Error = |q, good, method| match q > 0.5 {
        true => as_said(q, good, method),
        false => 1.0,
    };
    assert!(matches!(
        verdict(3, never_better),
        Verdict::NotReproduced(_)
    ));
    let never_worse: Error = |_, good, method| as_said(0.0, good, method);
    assert!(matches!(verdict(3, never_worse), Verdict::NotReproduced(_)));
}

#[test]
fn tables_have_all_cells_and_the_printed_errors_beside_their_labels() {
    let trials = Trials::of(trials(6, as_said)).unwrap();
    let section = table1::section(&trials).unwrap();
    assert!(matches!(section.verdict, Verdict::DependsOnData(_)));
    for table in &section.tables {
        let complete = |row: &Vec<_>| row.len() == table.columns.len();
        assert!(table.rows.iter().all(complete), "{}", table.name);
    }
    // 4 scenes, 2 starts, 3 shares, 5 methods.
    assert_eq!(section.tables[3].rows.len(), 120);
    let good = &section.tables[0];
    let row = |scene: &str, labels: &str| {
        let of = |row: &&Vec<_>| row[0] == scene.into() && row[1] == labels.into();
        good.rows.iter().find(of).unwrap()
    };
    use crate::report::Cell::{Empty, Number};
    assert_eq!(row("tv", "60 %")[3..5], [Number(0.22, 2), Number(8.68, 2)]);
    assert_eq!(row("tv", "0 %")[3..5], [Empty, Empty]);
    assert_eq!(row("desk", "0 %")[3..5], [Number(5.42, 2), Number(0.05, 2)]);
    // 9 x (1 to 6), wrong labels.
    assert_eq!(row("tv", "60 %")[6], "32 [9.0, 54]".into());
}
