//! Report of calibrations in captured rooms.

use crate::evaluate::pairs::of_scenes_and_all;
use crate::evaluate::trial::Trial;
use crate::report::{Cell, Report, Section, Table};

/// Distance of the middle of the seen points from the truth beyond which an accepted pose is wrong, metres.
const OFF_M: f64 = 0.05;
/// The same in stated standard deviations.
const OFF_SIGMAS: f64 = 3.0;
/// Maximum number of listed wrong answers.
const LISTED: usize = 40;

/// Creates a table of the rooms and sensors, and one of the accepted poses that are off.
pub fn rooms_report(trials: &[Trial]) -> Report {
    let lead = format!(
        "{} looks of a headset without a start into maps of robots whose sensors are low (0.4 to 0.6 m) or high (1.1 to \
         1.4 m). Off is the middle of the seen points, beyond {OFF_M} m or {OFF_SIGMAS} stated standard deviations.",
        trials.len()
    );
    let title = "A headset and a robot that see tables from opposite sides";
    let scenes = of_scenes_and_all(trials);
    let rows = scenes.iter().map(|(name, of)| line(name, of));
    let columns = "room|trials|OK|OK, off by more than 0.05 m|OK, off by more than 3 sigmas|AMBIGUOUS|DEGENERATE|else|\
                   median of OK, m|largest of OK, m";
    let off = Table::new("off", OFF, OFF_COLUMNS, off(trials));
    let section = Section::of_table("rooms", title, columns, rows).with_table(off);
    Report::of_evaluation(title, lead, "rooms", vec![section])
}

const OFF: &str = "Poses that were OK and off";
const OFF_COLUMNS: &str = "room|seed|off, m|stated, m|height, m|reason";

/// Distance from the truth and its stated standard deviation, metres.
fn middle(trial: &Trial) -> (f64, f64) {
    let [off_m, sigma_m, _] = trial.middle.unwrap_or_default();
    (off_m, sigma_m)
}

fn is_off(trial: &Trial) -> bool {
    trial.is_accepted() && middle(trial).0 > OFF_M
}

fn is_beyond(trial: &Trial) -> bool {
    let (off_m, sigma_m) = middle(trial);
    trial.is_accepted() && off_m > OFF_SIGMAS * sigma_m
}

fn line(name: &str, trials: &[&Trial]) -> Vec<Cell> {
    let share = |holds: &dyn Fn(&Trial) -> bool| {
        let n = trials.iter().filter(|trial| holds(trial)).count();
        let percent = 100.0 * n as f64 / trials.len().max(1) as f64;
        Cell::from(format!("{n}, {percent:.0} %"))
    };
    let verdict = |t: &Trial| {
        t.judged
            .as_ref()
            .map_or(String::new(), |j| j.verdict.clone())
    };
    let is = |name: &'static str| move |t: &Trial| verdict(t) == name;
    let known = ["OK", "AMBIGUOUS", "DEGENERATE"];
    let accepted = trials.iter().filter(|t| t.is_accepted());
    let off_m = accepted.map(|t| middle(t).0).collect::<Vec<_>>();
    vec![
        name.into(),
        trials.len().into(),
        share(&Trial::is_accepted),
        share(&is_off),
        share(&is_beyond),
        share(&is("AMBIGUOUS")),
        share(&is("DEGENERATE")),
        share(&|t| !known.contains(&verdict(t).as_str())),
        Cell::number(crate::evaluate::median(off_m.iter().copied()), 3),
        Cell::number(off_m.iter().copied().reduce(f64::max), 3),
    ]
}

fn off(trials: &[Trial]) -> Vec<Vec<Cell>> {
    let off = trials.iter().filter(|t| is_off(t) || is_beyond(t));
    let line = |trial: &Trial| {
        let [off_m, sigma_m, height_m] = trial.middle.unwrap_or_default();
        let reason = trial.judged.as_ref().map_or("", |j| j.reason.as_str());
        vec![
            trial.cell.scene.as_str().into(),
            trial.cell.seed.to_string().into(),
            Cell::Number(off_m, 3),
            Cell::Number(sigma_m, 3),
            Cell::Number(height_m, 3),
            reason.into(),
        ]
    };
    off.take(LISTED).map(line).collect()
}
