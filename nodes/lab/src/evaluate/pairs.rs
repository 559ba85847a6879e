//! Pairs of scans: what they share, and tables of them.

use lattice_core::registration::{Calibration, PreparedCloud};
use nalgebra::{Isometry3, Point3};

use super::settings::Cell;
use super::statistics::{mean, median};
use super::trial::{OURS, Trial, WRONG, rounded};
use crate::report::Cell as Entry;

/// Share of points that a map has too, within a distance.
pub fn shared(
    points_m: &[Point3<f64>],
    map: &PreparedCloud,
    map_from_points: &Isometry3<f64>,
    within_m: f64,
) -> f64 {
    let near = |p: &&Point3<f64>| map.nearest(&(map_from_points * **p), within_m).is_some();
    points_m.iter().filter(near).count() as f64 / points_m.len().max(1) as f64
}

/// Trial of a calibration, given the points that were seen and the share of them in the map.
pub fn trial(
    cell: &Cell,
    found: &Calibration,
    truth: &Isometry3<f64>,
    seen_m: &[Point3<f64>],
    overlap: f64,
) -> Trial {
    Trial {
        overlap: Some(rounded(overlap)),
        ..Trial::of_calibration(cell, OURS, found, truth, seen_m)
    }
}

/// Trials by a name, in the order of the trials.
pub fn by_name<'a>(
    trials: impl Iterator<Item = &'a Trial>,
    name: impl Fn(&'a Trial) -> &'a str,
) -> Vec<(&'a str, Vec<&'a Trial>)> {
    let mut scenes: Vec<(&str, Vec<&Trial>)> = Vec::new();
    for trial in trials {
        let name = name(trial);
        match scenes.iter_mut().find(|(known, _)| *known == name) {
            Some((_, of)) => of.push(trial),
            None => scenes.push((name, vec![trial])),
        }
    }
    scenes
}

/// Trials by the name of their scene, and all of them.
pub fn of_scenes_and_all(trials: &[Trial]) -> Vec<(&str, Vec<&Trial>)> {
    let mut scenes = by_name(trials.iter(), |trial| &trial.cell.scene);
    scenes.push(("all", trials.iter().collect()));
    scenes
}

/// Cells of a trial: metres, degrees, log-margin and per cent on the map.
pub fn errors(trial: &Trial) -> [Entry; 4] {
    let judged = trial.judged.as_ref();
    [
        Entry::Number(trial.translation_m, 3),
        Entry::Number(trial.rotation_deg, 2),
        Entry::number(judged.and_then(|j| j.margin), 0),
        Entry::number(judged.map(|j| 100.0 * j.inliers), 0),
    ]
}

/// Titles of a table whose rows are of `what`.
pub fn columns(what: &str) -> String {
    format!(
        "{what}|trials|OK and right|OK and wrong|refused, right|refused, wrong|median overlap|median NEES of OK|mean"
    )
}

/// A row of [`columns`] of the trials of a name.
pub fn line(name: &str, trials: &[&Trial]) -> Vec<Entry> {
    let count = |accepted: bool, right: bool| {
        let is = |t: &&&Trial| t.is_accepted() == accepted && t.is_within(WRONG) == right;
        let n = trials.iter().filter(is).count();
        let percent = 100.0 * n as f64 / trials.len().max(1) as f64;
        format!("{n}, {percent:.0} %")
    };
    let accepted = trials.iter().filter(|t| t.is_accepted());
    let nees: Vec<f64> = accepted.filter_map(|t| t.judged.as_ref()?.nees).collect();
    vec![
        name.into(),
        trials.len().into(),
        count(true, true).into(),
        count(true, false).into(),
        count(false, true).into(),
        count(false, false).into(),
        Entry::number(median(trials.iter().filter_map(|t| t.overlap)), 2),
        Entry::number(median(nees.iter().copied()), 1),
        Entry::number(mean(&nees), 1),
    ]
}
