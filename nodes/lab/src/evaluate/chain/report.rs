//! The report of the chain.

use super::super::pairs::errors;
use super::super::statistics::{Share, median};
use super::super::trial::{OURS, Trial, WRONG};
use super::methods::{COMPETITOR, STARTS, TRUE_LABELS, UNLABELLED};
use crate::evaluate::settings::Start;
use crate::report::{Cell, Report, Section, Table};

/// Goals: least share of OK, and most of OK that may be wrong, percent.
const GOALS: [u32; 2] = [85, 2];

/// A table of the methods, one of the scenes, and the answers of ours that were OK and wrong.
pub fn chain_report(trials: &[Trial]) -> Report {
    let title = "From images to a verdict, with a network";
    let lead = format!(
        "Rendered rooms, labelled by the network, calibrated without a start; right is within {} m and {} degrees. \
         Goals: at least {} % OK, at most {} % of the OK wrong. Intervals are of 95 % (Wilson). docs/dev/calibration.md says \
         how it is made.",
        WRONG.m, WRONG.deg, GOALS[0], GOALS[1]
    );
    let sections = vec![methods(trials), scenes(trials), wrong(trials)];
    Report::of_evaluation(title, lead, "chain", sections)
}

fn methods(trials: &[Trial]) -> Section {
    let ours = [
        ("ours, labels of the network", OURS),
        ("ours, without labels", UNLABELLED),
        ("ours, true labels", TRUE_LABELS),
    ];
    let ours = ours.map(|(title, method)| (title.to_owned(), method, Start::None));
    let others = STARTS.map(|start| {
        let title = match start {
            Start::Off { m, deg } => format!("GICP-SE(3), start {m} m and {deg} degrees off"),
            Start::None => "GICP-SE(3), no start".to_owned(),
        };
        (title, COMPETITOR, start)
    });
    let line = |(title, method, start): (String, &str, Start)| -> Vec<Cell> {
        let start = start.to_string();
        let of: Vec<&Trial> = (trials.iter())
            .filter(|t| t.method == method && t.cell.start == start)
            .collect();
        let mut cells: Vec<Cell> = vec![title.into(), of.len().into()];
        cells.extend(line_of(&of, method != COMPETITOR));
        cells
    };
    let rows = ours.into_iter().chain(others);
    let columns = "method|trials|right|OK|of the OK wrong|median error of the right (m)";
    let title = "What labels of the network are worth";
    Section::of_table("methods", title, columns, rows.map(line))
}

/// Shares of right answers, of OK, and of wrong ones among them; the median error of the right.
fn line_of(of: &[&Trial], judged: bool) -> [Cell; 4] {
    let right = Share::of(of.iter().map(|t| t.is_within(WRONG)));
    let accepted = Share::of(of.iter().map(|t| t.is_accepted()));
    let ok = of.iter().filter(|t| t.is_accepted());
    let wrong = Share::of(ok.map(|t| !t.is_within(WRONG)));
    let near = of.iter().filter(|t| t.is_within(WRONG));
    let error_m = median(near.map(|t| t.translation_m));
    let stated = |share: Share| match judged {
        true => Cell::from(share.text(0)),
        false => Cell::Empty,
    };
    [
        right.text(0).into(),
        stated(accepted),
        stated(wrong),
        Cell::number(error_m, 3),
    ]
}

fn scenes(trials: &[Trial]) -> Section {
    let mut names: Vec<&str> = trials.iter().map(|t| t.cell.scene.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let line = |scene: Option<&str>| -> Vec<Cell> {
        let of: Vec<&Trial> = (trials.iter())
            .filter(|t| t.method == OURS && scene.is_none_or(|scene| t.cell.scene == scene))
            .collect();
        let percent = |of_trial: fn(&Trial) -> Option<f64>| {
            let share = median(of.iter().filter_map(|t| of_trial(t)));
            Cell::number(share.map(|share| 100.0 * share), 0)
        };
        let mut cells: Vec<Cell> = vec![scene.unwrap_or("all").into()];
        cells.extend(line_of(&of, true));
        cells.push(percent(|t| t.labels.map(|labels| labels.map)));
        cells.push(percent(|t| t.labels.map(|labels| labels.headset)));
        cells.push(percent(|t| Some(t.different_share)));
        cells
    };
    let rows = names.into_iter().map(Some).chain([None]).map(line);
    let columns = "scene|right|OK|of the OK wrong|median error of the right (m)|voxels of the map rightly labelled (%)|\
                   points of the headset rightly labelled (%)|points that differ from the map (%)";
    let title = "Ours with labels of the network, by scene";
    let finding = "Shares of labels are medians of the trials.";
    let table = Table::new("scenes", title, columns, rows);
    Section::measured("scenes", title, finding).with_table(table)
}

fn wrong(trials: &[Trial]) -> Section {
    let ours = trials.iter().filter(|t| t.method != COMPETITOR);
    let failed = ours.filter(|t| !t.is_accepted() || !t.is_within(WRONG));
    let line = |t: &Trial| -> Vec<Cell> {
        let verdict = t.judged.as_ref().map_or("", |j| j.verdict.as_str());
        let seed = t.cell.seed.to_string();
        let names = [t.method.as_str(), &t.cell.scene, &seed, verdict].map(Cell::from);
        names.into_iter().chain(errors(t)).collect()
    };
    let columns = "method|scene|seed|verdict|m|degrees|log-margin|% on the map";
    let title = "Answers of ours that were wrong or not OK";
    Section::of_table("failed", title, columns, failed.map(line))
}
