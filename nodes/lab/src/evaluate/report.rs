//! The report of a calibration evaluation.

use super::figures;
use super::methods::{competitors, title};
use super::summary::{Accepted, Row, Summary};
use super::trial::Trial;
use crate::AnyError;
use crate::report::{Cell, Report, Section, Table};

/// Failures that are listed; all are in summary.json.
const LISTED: usize = 60;

/// The report of a summary, with pictures of its trials.
pub fn report(summary: &Summary, trials: &[Trial]) -> Result<Report, AnyError> {
    let settings = &summary.settings;
    let part = match settings.view_part {
        part if part < 1.0 => format!(", the left {:.0} % of each", 100.0 * part),
        _ => String::new(),
    };
    let lead = format!(
        "{} results; map cells of {} m, {} surveys of {} views, {} picture(s) of the headset{part}; {}. \
         docs/dev/calibration.md says how it is done. A pose is right within 0.15 m and 3 degrees; q is the \
         share of the view whose objects are labelled wrongly in the map or in the headset. \
         Brackets are 95 % intervals (Wilson).",
        summary.trials,
        settings.cell_side_m,
        settings.map_seeds,
        settings.survey_views,
        settings.headset_scans,
        settings.mesh_name(),
    );
    let sections = vec![
        printed(summary)?,
        by_start(summary)?,
        paired(summary, trials)?,
        accepted(summary, trials)?,
        consistency(summary),
        times(summary),
        failures(summary),
    ];
    let title = "Calibration, measured in simulation";
    Ok(Report::of_evaluation(title, lead, "calibration", sections))
}

fn find<'a>(
    summary: &'a Summary,
    scene: &str,
    start: &str,
    q: f64,
    method: &str,
) -> Option<&'a Row> {
    let of = |r: &&Row| r.scene == scene && r.start == start && r.q == q && r.method == method;
    summary.rows.iter().find(of)
}

/// A share of wrong labels, or all of them.
fn share_cell(q: Option<f64>) -> Cell {
    q.map_or("all".into(), |q| q.to_string().into())
}

fn printed(summary: &Summary) -> Result<Section, AnyError> {
    let flips = summary.flips();
    let (low, high) = (flips.first().copied(), flips.last().copied());
    let table = |(number, start): (usize, &&str)| {
        let row = |printed: &super::Printed| {
            let mut row = vec![
                printed.scene.into(),
                Cell::Number(printed.gicp_se3, 2),
                Cell::Number(printed.semantic_icp, 2),
            ];
            for method in competitors() {
                for q in [low, high] {
                    let of = |q| find(summary, printed.scene, start, q, method);
                    row.push(Cell::number(q.and_then(of).and_then(|r| r.d_se3), 2));
                }
            }
            row
        };
        let mut columns = "scene|paper: GICP-SE(3)|paper: Semantic-ICP".to_owned();
        for method in competitors() {
            let of = |q: Option<f64>| format!("|{}, q = {}", title(method), q.unwrap_or_default());
            columns.extend([of(low), of(high)]);
        }
        Table::new(
            format!("d_se3_{number}"),
            format!("Median d_SE3, start {start} (metres/degrees off)"),
            &columns,
            summary.printed.iter().map(row),
        )
    };
    let starts = summary.starts();
    let known = starts.iter().filter(|start| **start != "none");
    Ok(Section {
        tables: known.enumerate().map(table).collect(),
        figures: vec![figures::d_se3(summary)?],
        ..Section::measured(
            "printed",
            "Table 1 of the paper",
            "Median d_SE3 = ||log(T* T_GT^-1)|| of the least and the largest share of wrong labels. The paper prints \
             one run for each scene and tells neither start nor labels; its d_SE3 depends on where the origin of the \
             map is, so that it is the pattern that compares, not the digits.",
        )
    })
}

fn by_start(summary: &Summary) -> Result<Section, AnyError> {
    let flips = summary.flips();
    let table = |(number, start): (usize, &str)| {
        let row = |method: &'static str| {
            let of = |q: &f64| find(summary, "all", start, *q, method);
            let cell = |q| of(q).map_or(Cell::Empty, |r| r.success.text(1).into());
            let cells: Vec<Cell> = flips.iter().map(cell).collect();
            let any = cells.iter().any(|cell| *cell != Cell::Empty);
            any.then(|| std::iter::once(title(method).into()).chain(cells).collect())
        };
        let mut columns = "method".to_owned();
        columns.extend(flips.iter().map(|q| format!("|q = {q}")));
        Table::new(
            format!("right_{number}"),
            format!("Right poses, start {start}"),
            &columns,
            competitors().filter_map(row),
        )
    };
    Ok(Section {
        tables: summary
            .starts()
            .into_iter()
            .enumerate()
            .map(table)
            .collect(),
        figures: vec![figures::success(summary)?],
        ..Section::measured("right", "Right poses, all scenes", "")
    })
}

fn paired(summary: &Summary, trials: &[Trial]) -> Result<Section, AnyError> {
    let columns =
        "against|start|q|not worse|not worse or saved|not worse in the view|saved|spoiled";
    let rows = competitors().flat_map(|method| {
        let detailed = ["gicp", "gicp_se3"].contains(&method);
        let of = summary.paired.iter().filter(move |p| p.against == method);
        let of = of.filter(move |p| detailed || (p.start == "all" && p.q.is_none()));
        of.map(move |row| {
            vec![
                title(method).into(),
                row.start.as_str().into(),
                share_cell(row.q),
                row.not_worse.text(1).into(),
                row.not_worse_or_saved.text(1).into(),
                row.not_worse_in_view.text(1).into(),
                row.saved.k.into(),
                row.spoiled.k.into(),
            ]
        })
    });
    Ok(Section {
        tables: vec![Table::new("paired", "Trial by trial", columns, rows)],
        figures: vec![figures::paired(trials)?],
        ..Section::measured(
            "paired",
            "Ours against the others, from the same starts",
            "Not worse: distance and angle both at most 1 cm and 0.2 degrees above the other's. In the view: \
             mean distance of the seen points, at most 1 cm above. Saved: ours right, the other wrong; \
             spoiled: the reverse. Refused poses of ours count like all others.",
        )
    })
}

fn accepted(summary: &Summary, trials: &[Trial]) -> Result<Section, AnyError> {
    let columns = "start|scene|q|right before any verdict|accepted|wrong of these, 0.15 m|\
        wrong of these, 0.10 m|wrong of these, 0.15 m in the view|verdicts";
    let shown = |a: &&Accepted| a.q.is_none() || a.scene == "all";
    let rows = summary.accepted.iter().filter(shown).map(|row| {
        let verdicts = row.verdicts.iter().map(|(name, n)| format!("{name} {n}"));
        vec![
            row.start.as_str().into(),
            row.scene.as_str().into(),
            share_cell(row.q),
            row.right.text(1).into(),
            row.accepted.text(1).into(),
            row.wrong.text(1).into(),
            row.wrong_tight.text(1).into(),
            row.wrong_in_view.text(1).into(),
            verdicts.collect::<Vec<_>>().join(", ").into(),
        ]
    });
    Ok(Section {
        tables: vec![Table::new("accepted", "Accepted poses", columns, rows)],
        figures: vec![figures::margins(trials)?],
        ..Section::measured("accepted", "What is accepted", "")
    })
}

fn consistency(summary: &Summary) -> Section {
    let rows = summary.consistency.iter().map(|row| {
        vec![
            row.start.as_str().into(),
            row.n.into(),
            Cell::number(row.mean_over_6, 2),
            Cell::number(row.median_over_expected, 2),
        ]
    });
    let columns = "start|poses|mean / 6|median / 5.35";
    let table = Table::new("covariance", "Normalised squared errors", columns, rows);
    let finding = "Normalised squared error of accepted poses, 6 degrees of freedom: 1 is right, less is cautious.";
    let title = "Whether the stated covariance is right";
    Section::measured("covariance", title, finding).with_table(table)
}

fn times(summary: &Summary) -> Section {
    let timed = summary.times.iter();
    let timed = timed.filter(|row| row.method != super::methods::START);
    let rows = timed.map(|row| {
        vec![
            title(&row.method).into(),
            row.start.as_str().into(),
            row.n.into(),
            Cell::number(row.median_ms, 0),
            Cell::number(row.p90_ms, 0),
        ]
    });
    let columns = "method|start|trials|median (ms)|90 % below (ms)";
    let finding = format!(
        "Wall time, the map being ready. Those taken alone had {} threads; all others one, beside other trials.",
        summary.timed_threads
    );
    let table = Table::new("times", "Wall times", columns, rows);
    Section::measured("times", "Times", finding).with_table(table)
}

fn failures(summary: &Summary) -> Section {
    let columns = "scene|seed|q|start|verdict|margin|on the map|m|degrees|chosen|reason";
    // Accepted and wrong ones first.
    let mut listed: Vec<_> = summary.failures.iter().collect();
    listed.sort_by_key(|t| !t.is_accepted());
    let rows = listed.into_iter().take(LISTED).filter_map(|trial| {
        let judged = trial.judged.as_ref()?;
        let cell = &trial.cell;
        Some(vec![
            cell.scene.as_str().into(),
            Cell::Count(cell.seed),
            share_cell(Some(cell.q)),
            cell.start.as_str().into(),
            judged.verdict.as_str().into(),
            Cell::number(judged.margin, 1),
            Cell::Number(judged.inliers, 2),
            Cell::Number(trial.translation_m, 3),
            Cell::Number(trial.rotation_deg, 2),
            judged.chosen.as_str().into(),
            judged.reason.as_str().into(),
        ])
    });
    let all = summary.failures.len();
    let finding = format!("{all} trials; at most {LISTED} are listed, all are in summary.json.");
    let table = Table::new("failures", "Failures", columns, rows);
    Section::measured("failures", "Refused, or accepted and wrong", finding).with_table(table)
}
