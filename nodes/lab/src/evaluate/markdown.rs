//! The report as text.

use std::fmt::Write;

use super::methods::Baseline;
use super::statistics::Share;
use super::summary::{Accepted, Row, Summary};
use super::trial::{OURS, TIMED, TRACKED};

/// Failures that are listed; all are in report.json.
const LISTED: usize = 60;

/// The report in Markdown, with its pictures beside it.
pub fn markdown(summary: &Summary) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut text, summary);
    text
}

fn write(text: &mut String, summary: &Summary) -> std::fmt::Result {
    let settings = &summary.settings;
    writeln!(text, "# Calibration, measured in simulation\n")?;
    writeln!(
        text,
        "{} results; map cells of {} m, {} surveys of {} views, {} picture(s) of the headset; {}. \
         `docs/calibration.md` says how it is done. A pose is right within 0.15 m and 3 degrees; q is the \
         share of the view whose objects are labelled wrongly in the map or in the headset. \
         Brackets are 95 % intervals (Wilson).\n",
        summary.trials,
        settings.cell_side_m,
        settings.map_seeds,
        settings.survey_views,
        settings.headset_scans,
        match settings.mesh_crc32 {
            Some(crc) => format!("mesh with CRC-32 {crc:08x}"),
            None => "the house of our own making".to_owned(),
        },
    )?;
    printed(text, summary)?;
    by_start(text, summary)?;
    paired(text, summary)?;
    accepted(text, summary)?;
    consistency(text, summary)?;
    times(text, summary)?;
    failures(text, summary)
}

/// Methods in the order of the tables, with their titles.
pub(super) fn methods() -> Vec<(&'static str, &'static str)> {
    let baselines = Baseline::all().into_iter().map(|b| (b.name, b.title));
    baselines.chain([(OURS, "ours")]).collect()
}

fn titled(name: &str) -> &str {
    let extra = [(TIMED, "ours, alone"), (TRACKED, "tracking, alone")];
    let mut all = methods().into_iter().chain(extra);
    all.find(|(of, _)| *of == name)
        .map_or(name, |(_, title)| title)
}

fn starts(summary: &Summary) -> Vec<String> {
    let mut starts: Vec<String> = summary.rows.iter().map(|r| r.start.clone()).collect();
    starts.sort_unstable();
    starts.dedup();
    starts
}

fn flips(summary: &Summary) -> Vec<f64> {
    let mut flips: Vec<f64> = summary.rows.iter().map(|r| r.q).collect();
    flips.sort_by(f64::total_cmp);
    flips.dedup();
    flips
}

fn find<'a>(
    summary: &'a Summary,
    scene: &str,
    start: &str,
    q: f64,
    method: &str,
) -> Option<&'a Row> {
    summary
        .rows
        .iter()
        .find(|r| r.scene == scene && r.start == start && r.q == q && r.method == method)
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |v| format!("{v:.digits$}"))
}

fn percent(share: &Share) -> String {
    match share.share {
        Some(value) => format!(
            "{:.1} % of {} [{:.1}, {:.1}]",
            100.0 * value,
            share.n,
            100.0 * share.low,
            100.0 * share.high
        ),
        None => "-".to_owned(),
    }
}

fn head(text: &mut String, columns: &[&str]) -> std::fmt::Result {
    writeln!(text, "| {} |", columns.join(" | "))?;
    writeln!(text, "|{}", "---|".repeat(columns.len()))
}

fn printed(text: &mut String, summary: &Summary) -> std::fmt::Result {
    let flips = flips(summary);
    let (Some(&low), Some(&high)) = (flips.first(), flips.last()) else {
        return Ok(());
    };
    writeln!(text, "## Table 1 of the paper\n")?;
    writeln!(
        text,
        "Median d_SE3 = ||log(T* T_GT^-1)|| of q = {low} / q = {high}. The paper prints one run for each \
         scene and tells neither start nor labels; its d_SE3 depends on where the origin of the map is, \
         so that it is the pattern that compares, not the digits.\n"
    )?;
    for start in starts(summary).iter().filter(|start| *start != "none") {
        writeln!(text, "Start {start} (metres/degrees off):\n")?;
        let mut columns = vec!["scene", "paper: GICP-SE(3)", "paper: Semantic-ICP"];
        columns.extend(methods().iter().map(|(_, title)| *title));
        head(text, &columns)?;
        for printed in &summary.printed {
            write!(
                text,
                "| {} | {} | {} |",
                printed.scene, printed.gicp_se3, printed.semantic_icp
            )?;
            for (method, _) in methods() {
                let median =
                    |q| find(summary, printed.scene, start, q, method).and_then(|r| r.d_se3);
                write!(
                    text,
                    " {} / {} |",
                    number(median(low), 2),
                    number(median(high), 2)
                )?;
            }
            writeln!(text)?;
        }
        writeln!(text)?;
    }
    writeln!(
        text,
        "![Median d_SE3 by the share of wrong labels](d_se3.svg)\n"
    )
}

fn by_start(text: &mut String, summary: &Summary) -> std::fmt::Result {
    writeln!(text, "## Right poses, all scenes\n")?;
    for start in starts(summary) {
        writeln!(text, "Start {start}:\n")?;
        let flips = flips(summary);
        let named: Vec<String> = flips.iter().map(|q| format!("q = {q}")).collect();
        let mut columns = vec!["method"];
        columns.extend(named.iter().map(String::as_str));
        head(text, &columns)?;
        for (method, title) in methods() {
            let of = |q: &f64| find(summary, "all", &start, *q, method);
            if flips.iter().all(|q| of(q).is_none()) {
                continue;
            }
            let cells = flips
                .iter()
                .map(|q| of(q).map_or("-".to_owned(), |r| percent(&r.success)));
            writeln!(
                text,
                "| {title} | {} |",
                cells.collect::<Vec<_>>().join(" | ")
            )?;
        }
        writeln!(text)?;
    }
    writeln!(
        text,
        "![Right poses by the share of wrong labels](success.svg)\n"
    )
}

fn paired(text: &mut String, summary: &Summary) -> std::fmt::Result {
    writeln!(text, "## Ours against the others, from the same starts\n")?;
    writeln!(
        text,
        "Not worse: distance and angle both at most 1 cm and 0.2 degrees above the other's. In the view: \
         mean distance of the seen points, at most 1 cm above. Saved: ours right, the other wrong; \
         spoiled: the reverse. Refused poses of ours count like all others.\n"
    )?;
    let columns = [
        "against",
        "start",
        "q",
        "not worse",
        "not worse or saved",
        "not worse in the view",
        "saved",
        "spoiled",
    ];
    head(text, &columns)?;
    for (method, title) in methods() {
        let detailed = ["gicp", "gicp_se3"].contains(&method);
        let of = summary.paired.iter().filter(|p| p.against == method);
        for row in of.filter(|p| detailed || (p.start == "all" && p.q.is_none())) {
            writeln!(
                text,
                "| {title} | {} | {} | {} | {} | {} | {} | {} |",
                row.start,
                row.q.map_or("all".to_owned(), |q| q.to_string()),
                percent(&row.not_worse),
                percent(&row.not_worse_or_saved),
                percent(&row.not_worse_in_view),
                row.saved.k,
                row.spoiled.k,
            )?;
        }
    }
    writeln!(
        text,
        "\n![Ours against GICP-SE(3), trial by trial](paired.svg)\n"
    )
}

fn accepted(text: &mut String, summary: &Summary) -> std::fmt::Result {
    writeln!(text, "## What is accepted\n")?;
    let columns = [
        "start",
        "scene",
        "q",
        "right before any verdict",
        "accepted",
        "wrong of these, 0.15 m",
        "wrong of these, 0.10 m",
        "wrong of these, 0.15 m in the view",
        "verdicts",
    ];
    head(text, &columns)?;
    let shown = |a: &&Accepted| a.q.is_none() || a.scene == "all";
    for row in summary.accepted.iter().filter(shown) {
        let verdicts = row.verdicts.iter().map(|(name, n)| format!("{name} {n}"));
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            row.start,
            row.scene,
            row.q.map_or("all".to_owned(), |q| q.to_string()),
            percent(&row.right),
            percent(&row.accepted),
            percent(&row.wrong),
            percent(&row.wrong_tight),
            percent(&row.wrong_in_view),
            verdicts.collect::<Vec<_>>().join(", "),
        )?;
    }
    writeln!(
        text,
        "\n![Margins of right and wrong poses without a start](margins.svg)\n"
    )
}

fn consistency(text: &mut String, summary: &Summary) -> std::fmt::Result {
    writeln!(text, "## Whether the stated covariance is right\n")?;
    writeln!(
        text,
        "Normalised squared error of accepted poses, 6 degrees of freedom: 1 is right, less is cautious.\n"
    )?;
    head(text, &["start", "poses", "mean / 6", "median / 5.35"])?;
    for row in &summary.consistency {
        writeln!(
            text,
            "| {} | {} | {} | {} |",
            row.start,
            row.n,
            number(row.mean_over_6, 2),
            number(row.median_over_expected, 2)
        )?;
    }
    writeln!(text)
}

fn times(text: &mut String, summary: &Summary) -> std::fmt::Result {
    writeln!(text, "## Times\n")?;
    writeln!(
        text,
        "Wall time, the map being ready. Those taken alone had {} threads; all others one, beside other \
         trials.\n",
        summary.timed_threads
    )?;
    head(
        text,
        &[
            "method",
            "start",
            "trials",
            "median (ms)",
            "90 % below (ms)",
        ],
    )?;
    for row in summary.times.iter().filter(|row| row.method != "start") {
        writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            titled(&row.method),
            row.start,
            row.n,
            number(row.median_ms, 0),
            number(row.p90_ms, 0)
        )?;
    }
    writeln!(text)
}

fn failures(text: &mut String, summary: &Summary) -> std::fmt::Result {
    let all = summary.failures.len();
    writeln!(text, "## Refused, or accepted and wrong: {all}\n")?;
    if all > LISTED {
        writeln!(text, "The first {LISTED}; all are in `report.json`.\n")?;
    }
    let columns = [
        "scene",
        "seed",
        "q",
        "start",
        "verdict",
        "margin",
        "on the map",
        "m",
        "degrees",
        "chosen",
        "reason",
    ];
    head(text, &columns)?;
    // Accepted and wrong ones first.
    let mut listed: Vec<_> = summary.failures.iter().collect();
    listed.sort_by_key(|t| !t.is_accepted());
    for trial in listed.into_iter().take(LISTED) {
        let Some(judged) = &trial.judged else {
            continue;
        };
        let cell = &trial.cell;
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {:.2} | {:.3} | {:.2} | {} | {} |",
            cell.scene,
            cell.seed,
            cell.q,
            cell.start,
            judged.verdict,
            number(judged.margin, 1),
            judged.inliers,
            trial.translation_m,
            trial.rotation_deg,
            judged.chosen,
            judged.reason.replace('|', "/"),
        )?;
    }
    Ok(())
}
