//! The report of the traps.

use super::scenes::Fault;
use super::{ALIKE, BROKEN, WRONG_INPUT};
use crate::evaluate::trial::{Trial, WRONG};
use crate::report::{Cell, Report, Section, Table};

/// Wrong answers that are listed.
const LISTED: usize = 40;

/// A table for each kind of trap, and the answers that were called OK and are wrong.
pub fn traps_report(trials: &[Trial]) -> Report {
    let lead = format!(
        "{} calibrations without a start that must not be certain of a wrong pose: beyond {} m or {} degrees. \
         docs/calibration.md says how the scenes are made.",
        trials.len(),
        WRONG.m,
        WRONG.deg
    );
    let sections = vec![
        section(trials, ALIKE, "Rooms that look alike from several places"),
        section(trials, BROKEN, "The same with a box in sight"),
        faults(trials),
        wrong(trials),
    ];
    let title = "Calibrations that must not be certain";
    Report::new(title, lead, "lattice evaluate traps".to_owned(), sections)
}

fn is_wrong(trial: &Trial) -> bool {
    trial.is_accepted() && !trial.is_within(WRONG)
}

/// Trials of a kind, by the rest of their scene's name.
fn of_kind<'a>(trials: &'a [Trial], kind: &str) -> Vec<(&'a str, Vec<&'a Trial>)> {
    let mut scenes: Vec<(&str, Vec<&Trial>)> = Vec::new();
    for trial in trials {
        let name = trial.cell.scene.split_once('/');
        let Some((_, name)) = name.filter(|(of, _)| *of == kind) else {
            continue;
        };
        match scenes.iter_mut().find(|(known, _)| *known == name) {
            Some((_, all)) => all.push(trial),
            None => scenes.push((name, vec![trial])),
        }
    }
    scenes
}

/// Number of trials of which something holds, and their share.
fn share(trials: &[&Trial], holds: impl Fn(&Trial) -> bool) -> String {
    let n = trials.iter().filter(|trial| holds(trial)).count();
    let percent = 100.0 * n as f64 / trials.len().max(1) as f64;
    format!("{n}, {percent:.0} %")
}

fn verdict_is(trial: &Trial, name: &str) -> bool {
    trial.judged.as_ref().is_some_and(|j| j.verdict == name)
}

fn section(trials: &[Trial], kind: &str, title: &str) -> Section {
    let line = |name: &str, of: &[&Trial]| -> Vec<Cell> {
        vec![
            name.into(),
            of.len().into(),
            share(of, |t| t.is_accepted() && t.is_within(WRONG)).into(),
            share(of, is_wrong).into(),
            share(of, |t| verdict_is(t, "AMBIGUOUS")).into(),
            share(of, |t| !t.is_accepted() && !verdict_is(t, "AMBIGUOUS")).into(),
        ]
    };
    let scenes = of_kind(trials, kind);
    let all: Vec<&Trial> = scenes.iter().flat_map(|(_, of)| of.clone()).collect();
    let mut rows: Vec<Vec<Cell>> = scenes.iter().map(|(name, of)| line(name, of)).collect();
    rows.push(line("all", &all));
    let columns = "scene|trials|OK and right|OK and wrong|AMBIGUOUS|else";
    Section {
        tables: vec![Table::new(kind, title, columns, rows)],
        ..Section::measured(kind, title, "")
    }
}

fn faults(trials: &[Trial]) -> Section {
    let named = |name: &str, trial: &Trial| {
        let fault = Fault::all().into_iter().find(|fault| fault.name() == name);
        let reason = trial.judged.as_ref().map_or("", |j| &j.reason);
        !trial.is_accepted() && fault.is_some_and(|fault| fault.is_named_by(reason))
    };
    let scenes = of_kind(trials, WRONG_INPUT);
    let line = |(name, of): &(&str, Vec<&Trial>)| -> Vec<Cell> {
        vec![
            (*name).into(),
            of.len().into(),
            share(of, is_wrong).into(),
            share(of, Trial::is_accepted).into(),
            share(of, |trial| named(name, trial)).into(),
        ]
    };
    let mut rows: Vec<Vec<Cell>> = scenes.iter().map(line).collect();
    let all: Vec<&Trial> = scenes.iter().flat_map(|(_, of)| of.clone()).collect();
    let named = |trial: &Trial| {
        let name = trial.cell.scene.split_once('/').map_or("", |name| name.1);
        named(name, trial)
    };
    rows.push(vec![
        "all".into(),
        all.len().into(),
        share(&all, is_wrong).into(),
        share(&all, Trial::is_accepted).into(),
        share(&all, named).into(),
    ]);
    let columns = "cloud|trials|OK and wrong|OK|refused, with the cause named";
    let title = "Clouds that are not what they are said to be";
    Section {
        tables: vec![Table::new("faults", title, columns, rows)],
        ..Section::measured("faults", title, "")
    }
}

fn wrong(trials: &[Trial]) -> Section {
    let wrong = trials.iter().filter(|trial| is_wrong(trial)).take(LISTED);
    let line = |trial: &Trial| -> Vec<Cell> {
        vec![
            trial.cell.scene.as_str().into(),
            trial.cell.seed.to_string().into(),
            Cell::Number(trial.translation_m, 3),
            Cell::Number(trial.rotation_deg, 2),
            Cell::number(trial.judged.as_ref().and_then(|j| j.margin), 0),
            Cell::number(trial.judged.as_ref().map(|j| 100.0 * j.inliers), 0),
        ]
    };
    let rows: Vec<Vec<Cell>> = wrong.map(line).collect();
    let columns = "scene|seed|m|degrees|log-margin|% on the map";
    let title = "Answers that were OK and wrong";
    Section {
        tables: vec![Table::new("wrong", title, columns, rows)],
        ..Section::measured("wrong", title, "")
    }
}
