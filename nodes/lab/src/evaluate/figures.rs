//! The pictures of a calibration evaluation.

use super::methods::{color, competitors, title};
use super::summary::{Summary, sorted};
use super::trial::{OURS, Trial, WRONG};
use crate::AnyError;
use crate::report::Figure;
use crate::report::plot::{Area, Key, Layout, chart, svg};
use plotters::prelude::*;
use std::collections::BTreeMap;

/// Range of errors that is shown.
const ERRORS: std::ops::Range<f64> = 0.005..30.0;
/// Title and range of the axis of wrong labels.
const Q_AXIS: (&str, std::ops::Range<f64>) = ("share of wrong labels q", -0.02..0.85);
/// Colours of accepted and refused poses.
const ACCEPTED: RGBColor = RGBColor(0, 114, 178);
const REFUSED: RGBColor = RGBColor(213, 94, 0);

fn picture(
    name: &str,
    caption: &str,
    grid: [usize; 2],
    key: &[Key],
    draw: impl FnOnce(&[Area]) -> Result<(), AnyError>,
) -> Result<Figure, AnyError> {
    let picture = svg(&Layout::new((430, 330), grid, 170, key), draw)?;
    Ok(Figure::new(name, caption, picture))
}

const VERDICTS: [Key; 2] = [(ACCEPTED, "accepted"), (REFUSED, "refused")];

fn key_of_methods() -> Vec<Key<'static>> {
    competitors()
        .map(|name| (color(name), title(name)))
        .collect()
}

fn verdict_color(trial: &Trial) -> RGBColor {
    match trial.is_accepted() {
        true => ACCEPTED,
        false => REFUSED,
    }
}

fn shown(error: f64) -> f64 {
    error.clamp(ERRORS.start, ERRORS.end)
}

/// Median d_SE3 by q: a row for each start, a column for each scene.
pub fn d_se3(summary: &Summary) -> Result<Figure, AnyError> {
    let starts = summary.starts();
    let scenes = summary.scenes();
    let cells = starts.iter();
    let cells = cells.flat_map(|start| scenes.iter().map(move |scene| (*start, *scene)));
    let draw = |areas: &[Area]| {
        for ((start, scene), area) in cells.zip(areas) {
            let y = ("median d_SE3", ERRORS.log_scale());
            let mut chart = chart(area, &format!("{scene}, start {start}"), Q_AXIS, y, &[])?;
            for method in competitors() {
                let (color, rows) = (color(method), summary.of_method(scene, start, method));
                let points = rows.iter().filter_map(|r| Some((r.q, shown(r.d_se3?))));
                chart.draw_series(LineSeries::new(points.clone(), color.stroke_width(2)))?;
                chart.draw_series(points.map(|p| Circle::new(p, 3, color.filled())))?;
            }
        }
        Ok(())
    };
    let caption = "Median d_SE3 by the share of wrong labels";
    picture(
        "d_se3",
        caption,
        [scenes.len(), starts.len()],
        &key_of_methods(),
        draw,
    )
}

/// Right poses by q, all scenes: a panel for each start.
pub fn success(summary: &Summary) -> Result<Figure, AnyError> {
    let starts = summary.starts();
    let draw = |areas: &[Area]| {
        for (start, area) in starts.iter().zip(areas) {
            let y = ("right within 0.15 m and 3 deg", 0.0..1.02);
            let mut chart = chart(area, &format!("all scenes, start {start}"), Q_AXIS, y, &[])?;
            for method in competitors() {
                let (color, rows) = (color(method), summary.of_method("all", start, method));
                let points = rows.iter().filter_map(|r| Some((r.q, r.success.share?)));
                chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
                chart.draw_series(rows.iter().map(|r| {
                    let ends = [(r.q, r.success.low), (r.q, r.success.high)];
                    PathElement::new(ends, color.mix(0.5))
                }))?;
            }
        }
        Ok(())
    };
    let caption = "Right poses by the share of wrong labels";
    picture(
        "success",
        caption,
        [starts.len(), 1],
        &key_of_methods(),
        draw,
    )
}

/// Mean distance of the seen points, ours over GICP-SE(3), one dot a trial.
pub fn paired(trials: &[Trial]) -> Result<Figure, AnyError> {
    let of = |method: &'static str| trials.iter().filter(move |t| t.method == method);
    let theirs: BTreeMap<_, &Trial> = of("gicp_se3").map(|t| (t.cell.key(), t)).collect();
    let starts = sorted(theirs.values().map(|t| t.cell.start.as_str()));
    let draw = |areas: &[Area]| {
        for (start, area) in starts.iter().zip(areas) {
            let title = format!("mean distance in the view (m), start {start}");
            let [x, y] = ["GICP-SE(3)", "ours"].map(|name| (name, ERRORS.log_scale()));
            let mut chart = chart(area, &title, x, y, &[])?;
            let ends = [ERRORS.start, ERRORS.end].map(|e| (e, e));
            chart.draw_series(LineSeries::new(ends, BLACK.mix(0.4)))?;
            let ours = of(OURS).filter(|t| t.cell.start == *start);
            let pairs = ours.filter_map(|t| Some((t, *theirs.get(&t.cell.key())?)));
            chart.draw_series(pairs.map(|(a, b)| {
                let at = (shown(b.view_m), shown(a.view_m));
                Circle::new(at, 3, verdict_color(a).mix(0.6).filled())
            }))?;
        }
        Ok(())
    };
    let caption = "Ours against GICP-SE(3), trial by trial";
    picture("paired", caption, [starts.len(), 1], &VERDICTS, draw)
}

/// Log-margin over the error, without a start.
pub fn margins(trials: &[Trial]) -> Result<Figure, AnyError> {
    let margins = 0.1..100_000.0;
    let draw = |areas: &[Area]| {
        for area in areas {
            let x = ("distance from the truth (m)", ERRORS.log_scale());
            let y = ("log-margin", margins.clone().log_scale());
            let mut chart = chart(area, "no start", x, y, &[])?;
            let bound = [margins.start, margins.end].map(|m| (WRONG.m, m));
            chart.draw_series(LineSeries::new(bound, BLACK.mix(0.4)))?;
            let ours = |t: &&Trial| t.method == OURS && t.cell.start == "none";
            chart.draw_series(trials.iter().filter(ours).filter_map(|t| {
                let margin = t.judged.as_ref()?.margin.unwrap_or(margins.end);
                let margin = margin.clamp(margins.start, margins.end);
                let at = (shown(t.translation_m), margin);
                Some(Circle::new(at, 3, verdict_color(t).mix(0.6).filled()))
            }))?;
        }
        Ok(())
    };
    let caption = "Margins of right and wrong poses without a start";
    picture("margins", caption, [1, 1], &VERDICTS, draw)
}
