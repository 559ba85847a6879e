//! Report of the adversarial scenes.

use super::scenes::{ALIKE, BROKEN, Fault, NEARLY, WRONG_INPUT};
use crate::evaluate::pairs::{by_name, errors};
use crate::evaluate::trial::{Trial, WRONG};
use crate::report::{Cell, Report, Section};

/// Maximum number of listed wrong answers.
const LISTED: usize = 40;

/// Creates a table for each kind of scene, and lists the false accepts.
pub fn adversarial_report(trials: &[Trial]) -> Report {
    let lead = format!(
        "{} calibrations without a start that must not be certain of a wrong pose: beyond {} m or {} degrees. \
         docs/dev/calibration.md says how the scenes are made.",
        trials.len(),
        WRONG.m,
        WRONG.deg
    );
    let sections = vec![
        section(trials, ALIKE, "Rooms that look alike from several places"),
        section(trials, BROKEN, "The same with a box in sight"),
        section(
            trials,
            NEARLY,
            "The same with a cube of 20 to 60 cm, in small rooms of 10 to 40 cm, which may be too little to tell",
        ),
        faults(trials),
        wrong(trials),
    ];
    let title = "Calibrations that must not be certain";
    Report::of_evaluation(title, lead, "traps", sections)
}

fn is_wrong(trial: &Trial) -> bool {
    trial.is_accepted() && !trial.is_within(WRONG)
}

/// A line for each scene of a kind, by the rest of its name, and one for all of them.
fn lines(
    trials: &[Trial],
    kind: &str,
    line: impl Fn(&str, &[&Trial]) -> Vec<Cell>,
) -> Vec<Vec<Cell>> {
    let of_kind = trials.iter().filter(|trial| scene(trial).0 == kind);
    let mut scenes = by_name(of_kind.clone(), |trial| scene(trial).1);
    scenes.push(("all", of_kind.collect()));
    scenes.iter().map(|(name, of)| line(name, of)).collect()
}

/// Kind of the scene of a trial, and the rest of its name.
fn scene(trial: &Trial) -> (&str, &str) {
    trial.cell.scene.split_once('/').unwrap_or_default()
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
    let columns = "scene|trials|OK and right|OK and wrong|AMBIGUOUS|else";
    Section::of_table(kind, title, columns, lines(trials, kind, line))
}

fn faults(trials: &[Trial]) -> Section {
    let faults: Vec<(String, Fault)> = (Fault::all().into_iter())
        .map(|fault| (fault.name(), fault))
        .collect();
    let is_named = |trial: &Trial| {
        let fault = faults.iter().find(|(name, _)| name == scene(trial).1);
        let reason = trial.judged.as_ref().map_or("", |j| &j.reason);
        !trial.is_accepted() && fault.is_some_and(|(_, fault)| fault.is_named_by(reason))
    };
    let line = |name: &str, of: &[&Trial]| -> Vec<Cell> {
        vec![
            name.into(),
            of.len().into(),
            share(of, is_wrong).into(),
            share(of, Trial::is_accepted).into(),
            share(of, is_named).into(),
        ]
    };
    let columns = "cloud|trials|OK and wrong|OK|refused, with the cause named";
    let title = "Clouds that are not what they are said to be";
    Section::of_table("faults", title, columns, lines(trials, WRONG_INPUT, line))
}

fn wrong(trials: &[Trial]) -> Section {
    let wrong = trials.iter().filter(|trial| is_wrong(trial)).take(LISTED);
    let line = |trial: &Trial| -> Vec<Cell> {
        let names = [trial.cell.scene.clone(), trial.cell.seed.to_string()];
        let names = names.map(Cell::from);
        names.into_iter().chain(errors(trial)).collect()
    };
    let columns = "scene|seed|m|degrees|log-margin|% on the map";
    let title = "Answers that were OK and wrong";
    Section::of_table("wrong", title, columns, wrong.map(line))
}
