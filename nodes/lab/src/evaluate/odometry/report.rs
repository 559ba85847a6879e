//! Report of odometry: a line for each scene or log.

use std::collections::BTreeMap;

use super::loops::WRONG_M;
use super::measurement::{OdometryTrial, SEGMENT_M};
use crate::evaluate::median;
use crate::report::{Cell, Report, Section, Table};

/// A table with one line for each scene.
pub fn odometry_report(trials: &[OdometryTrial]) -> Report {
    report_of("Simulated drives with motion during each scan.", trials)
}

pub(super) fn report_of(lead: &str, trials: &[OdometryTrial]) -> Report {
    let mut scenes: BTreeMap<&str, Vec<&OdometryTrial>> = BTreeMap::new();
    for trial in trials {
        scenes.entry(&trial.scene).or_default().push(trial);
    }
    let rows = scenes.iter().map(|(scene, trials)| line(scene, trials));
    let columns = "scene|seeds|OK, %|WEAK, %|LOST, %|median ATE, m|largest error, m|median RPE, %|\
        wrong OK|OK beyond 3 sigma, %|median NEES|median time of a scan, ms|median processor time, ms|\
        loops closed|false loops|median ATE with loops, m|processor time of all loops, s";
    let lead = format!(
        "{lead} Errors are those of poses that are OK, since the beginnings of \
         their submaps; RPE over {SEGMENT_M} m; a pose that is OK and off by more than {WRONG_M} m is wrong, \
         and so is a loop. The ATE with loops is that of all submaps that loops join."
    );
    let title = "Lidar odometry against the truth";
    let table = Table::new("odometry", "All scenes", columns, rows);
    let section = Section::measured("odometry", title, "").with_table(table);
    Report::of_evaluation("Lidar odometry", lead, "odometry", vec![section])
}

fn line(scene: &str, trials: &[&OdometryTrial]) -> Vec<Cell> {
    let sum = |of: fn(&OdometryTrial) -> u64| trials.iter().map(|t| of(t)).sum::<u64>();
    let part = |count: u64, of: u64| format!("{:.1}", 100.0 * count as f64 / of.max(1) as f64);
    let middle = |of: fn(&OdometryTrial) -> Option<f64>, digits: usize| {
        let middle = median(trials.iter().filter_map(|t| of(t)));
        middle.map_or("-".to_owned(), |middle| format!("{middle:.digits$}"))
    };
    let largest_m = trials.iter().map(|t| t.largest_m).fold(0.0, f64::max);
    let scans = sum(|t| t.scans);
    vec![
        scene.into(),
        trials.len().into(),
        part(sum(|t| t.ok), scans).into(),
        part(sum(|t| t.weak), scans).into(),
        part(sum(|t| t.lost), scans).into(),
        middle(|t| Some(t.ate_m), 3).into(),
        format!("{largest_m:.3}").into(),
        middle(|t| t.rpe_percent, 2).into(),
        (sum(|t| t.wrong) as usize).into(),
        part(sum(|t| t.beyond_3_sigma), sum(|t| t.ok - t.without_truth)).into(),
        middle(|t| t.nees, 1).into(),
        middle(|t| Some(t.ms), 0).into(),
        middle(|t| Some(t.cpu_ms), 0).into(),
        (sum(|t| t.loops.closed) as usize).into(),
        (sum(|t| t.loops.wrong) as usize).into(),
        middle(|t| t.loops.ate_m, 3).into(),
        middle(|t| t.loops.cpu_s, 1).into(),
    ]
}
