//! The pictures of the report.

use std::path::Path;

use plotters::prelude::*;

use super::markdown::methods;
use super::summary::{Row, Summary};
use super::trial::{OURS, Trial, WRONG};
use crate::plot::{self, Area, Fault, Layout};

/// Size of one panel, pixels.
const PANEL: (u32, u32) = (430, 330);
/// Width of what the colours mean, pixels.
const KEY_WIDTH: u32 = 170;
/// Range of errors that is shown.
const ERRORS: std::ops::Range<f64> = 0.005..30.0;

/// Writes all pictures of a report into a folder.
pub fn draw(folder: &Path, summary: &Summary, trials: &[Trial]) -> Result<(), Fault> {
    d_se3(&folder.join("d_se3.svg"), summary)?;
    success(&folder.join("success.svg"), summary)?;
    paired(&folder.join("paired.svg"), trials)?;
    margins(&folder.join("margins.svg"), trials)
}

/// Colours that are told apart by most eyes (Wong 2011), ours in black.
fn color(method: &str) -> RGBColor {
    match method {
        "start" => RGBColor(170, 170, 170),
        "icp" => RGBColor(86, 180, 233),
        "gicp" => RGBColor(0, 114, 178),
        "gicp_se3" => RGBColor(0, 158, 115),
        "semantic_hard" => RGBColor(230, 159, 0),
        "semantic_soft" => RGBColor(240, 228, 66),
        "em_hard" => RGBColor(204, 121, 167),
        "class_wise" => RGBColor(213, 94, 0),
        "class_wise_cauchy" => RGBColor(128, 56, 0),
        _ => BLACK,
    }
}

/// Panels beside each other and below, with what their colours mean on the right.
fn panels<'a>(
    path: &'a Path,
    columns: usize,
    rows: usize,
    key: &[(RGBColor, &str)],
) -> Result<(Area<'a>, Vec<Area<'a>>), Fault> {
    let layout = Layout {
        panel: PANEL,
        columns,
        rows,
        key_width: KEY_WIDTH,
        key,
    };
    plot::panels(SVGBackend::new(path, layout.size()), &layout)
}

fn key_of_methods() -> Vec<(RGBColor, &'static str)> {
    let methods = methods().into_iter();
    methods
        .map(|(method, title)| (color(method), title))
        .collect()
}

/// Accepted and refused.
fn key_of_verdicts() -> [(RGBColor, &'static str); 2] {
    [
        (color("gicp"), "accepted"),
        (color("class_wise"), "refused"),
    ]
}

fn distinct(values: impl Iterator<Item = String>) -> Vec<String> {
    let mut values: Vec<String> = values.collect();
    values.sort_unstable();
    values.dedup();
    values
}

/// Lines of a value by q, one for each method.
fn lines<'a>(
    rows: &'a [Row],
    scene: &'a str,
    start: &'a str,
    value: impl Fn(&Row) -> Option<f64> + Copy + 'a,
) -> impl Iterator<Item = (&'static str, RGBColor, Vec<(f64, f64)>)> + 'a {
    methods().into_iter().filter_map(move |(method, _)| {
        let of = rows
            .iter()
            .filter(|r| r.scene == scene && r.start == start && r.method == method);
        let mut points: Vec<(f64, f64)> = of.filter_map(|r| Some((r.q, value(r)?))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        (!points.is_empty()).then(|| (method, color(method), points))
    })
}

/// Median d_SE3 by q: a row for each start, a column for each scene.
fn d_se3(path: &Path, summary: &Summary) -> Result<(), Fault> {
    let rows = &summary.rows;
    let starts = distinct(rows.iter().map(|r| r.start.clone()));
    let scenes = distinct(rows.iter().map(|r| r.scene.clone()).filter(|s| s != "all"));
    let (root, areas) = panels(path, scenes.len(), starts.len(), &key_of_methods())?;
    let cells = starts
        .iter()
        .flat_map(|start| scenes.iter().map(move |scene| (start, scene)));
    for ((start, scene), area) in cells.zip(&areas) {
        let mut chart = ChartBuilder::on(area)
            .caption(format!("{scene}, start {start}"), ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(48)
            .build_cartesian_2d(-0.02..0.85, ERRORS.log_scale())?;
        chart
            .configure_mesh()
            .x_desc("share of wrong labels q")
            .y_desc("median d_SE3")
            .light_line_style(WHITE)
            .draw()?;
        for (_, color, points) in lines(rows, scene, start, |r| r.d_se3) {
            let points: Vec<(f64, f64)> = points
                .into_iter()
                .map(|(q, d)| (q, d.clamp(ERRORS.start, ERRORS.end)))
                .collect();
            let marks = points.clone();
            chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
            chart.draw_series(marks.into_iter().map(|p| Circle::new(p, 3, color.filled())))?;
        }
    }
    Ok(root.present()?)
}

/// Right poses by q, all scenes: a panel for each start.
fn success(path: &Path, summary: &Summary) -> Result<(), Fault> {
    let rows = &summary.rows;
    let starts = distinct(rows.iter().map(|r| r.start.clone()));
    let (root, areas) = panels(path, starts.len(), 1, &key_of_methods())?;
    for (start, area) in starts.iter().zip(&areas) {
        let mut chart = ChartBuilder::on(area)
            .caption(format!("all scenes, start {start}"), ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(48)
            .build_cartesian_2d(-0.02..0.85, 0.0..1.02)?;
        chart
            .configure_mesh()
            .x_desc("share of wrong labels q")
            .y_desc("right within 0.15 m and 3 deg")
            .light_line_style(WHITE)
            .draw()?;
        for (method, color, points) in lines(rows, "all", start, |r| r.success.share) {
            chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
            let of = |r: &&Row| r.scene == "all" && &r.start == start && r.method == method;
            let bars = rows.iter().filter(of);
            chart.draw_series(bars.map(|r| {
                PathElement::new(
                    [(r.q, r.success.low), (r.q, r.success.high)],
                    color.mix(0.5),
                )
            }))?;
        }
    }
    Ok(root.present()?)
}

/// Mean distance of the seen points, ours over GICP-SE(3), one dot a trial.
fn paired(path: &Path, trials: &[Trial]) -> Result<(), Fault> {
    let key = |t: &Trial| {
        (
            t.cell.scene.clone(),
            t.cell.seed,
            t.cell.q.to_bits(),
            t.cell.start.clone(),
        )
    };
    let of = |method: &'static str| trials.iter().filter(move |t| t.method == method);
    let theirs: std::collections::BTreeMap<_, &Trial> =
        of("gicp_se3").map(|t| (key(t), t)).collect();
    let starts = distinct(theirs.values().map(|t| t.cell.start.clone()));
    let (root, areas) = panels(path, starts.len(), 1, &key_of_verdicts())?;
    for (start, area) in starts.iter().zip(&areas) {
        let mut chart = ChartBuilder::on(area)
            .caption(
                format!("mean distance in the view (m), start {start}"),
                ("sans-serif", 15),
            )
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(48)
            .build_cartesian_2d(ERRORS.log_scale(), ERRORS.log_scale())?;
        chart
            .configure_mesh()
            .x_desc("GICP-SE(3)")
            .y_desc("ours")
            .light_line_style(WHITE)
            .draw()?;
        let ends = [ERRORS.start, ERRORS.end].map(|e| (e, e));
        chart.draw_series(LineSeries::new(ends, BLACK.mix(0.4)))?;
        let ours = of(OURS).filter(|t| &t.cell.start == start);
        let pairs = ours.filter_map(|t| Some((t, *theirs.get(&key(t))?)));
        chart.draw_series(pairs.map(|(a, b)| {
            let clamped = |v: f64| v.clamp(ERRORS.start, ERRORS.end);
            let color = if a.is_accepted() {
                color("gicp")
            } else {
                color("class_wise")
            };
            Circle::new(
                (clamped(b.view_m), clamped(a.view_m)),
                3,
                color.mix(0.6).filled(),
            )
        }))?;
    }
    Ok(root.present()?)
}

/// Log-margin over the error, without a start.
fn margins(path: &Path, trials: &[Trial]) -> Result<(), Fault> {
    let (root, areas) = panels(path, 1, 1, &key_of_verdicts())?;
    let margins = 0.1..100_000.0;
    if let Some(area) = areas.first() {
        let mut chart = ChartBuilder::on(area)
            .caption("no start", ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(56)
            .build_cartesian_2d(ERRORS.log_scale(), margins.clone().log_scale())?;
        chart
            .configure_mesh()
            .x_desc("distance from the truth (m)")
            .y_desc("log-margin")
            .light_line_style(WHITE)
            .draw()?;
        let bound = [margins.start, margins.end].map(|m| (WRONG.m, m));
        chart.draw_series(LineSeries::new(bound, BLACK.mix(0.4)))?;
        let ours = trials
            .iter()
            .filter(|t| t.method == OURS && t.cell.start == "none");
        let dots = ours.filter_map(|t| {
            let margin = t.judged.as_ref()?.margin.unwrap_or(margins.end);
            let at = (
                t.translation_m.clamp(ERRORS.start, ERRORS.end),
                margin.clamp(margins.start, margins.end),
            );
            let color = if t.is_accepted() {
                color("gicp")
            } else {
                color("class_wise")
            };
            Some(Circle::new(at, 3, color.mix(0.6).filled()))
        });
        chart.draw_series(dots)?;
    }
    Ok(root.present()?)
}
