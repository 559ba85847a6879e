//! Every trial beside the printed errors, and medians by the share of wrong labels.

use super::median::Median;
use super::methods::{GICP, SEMANTIC, methods};
use super::printed::{blamed, printed};
use super::trials_of_methods::{Trials, in_words};
use crate::AnyError;
use crate::evaluate::{OURS, color, letters, title};
use crate::report::Figure;
use crate::report::plot::{Area, Layout, chart, svg};
use crate::simulate::house::Scene;
use plotters::prelude::*;

/// Range of errors that is shown; what is beyond lies on its ends.
const ERRORS: std::ops::Range<f64> = 0.01..40.0;
/// Right and wrong labels.
const LABELS: [(RGBColor, &str); 2] = [
    (RGBColor(0, 114, 178), "labels right"),
    (RGBColor(213, 94, 0), "labels wrong"),
];

fn shown(error: f64) -> f64 {
    error.clamp(ERRORS.start, ERRORS.end)
}

/// All trials: a row for each scene, a column for each start.
pub(super) fn dots(trials: &Trials) -> Result<Figure, AnyError> {
    let mut key = LABELS.to_vec();
    key.push((BLACK, "printed (diamond)"));
    let layout = Layout::new(
        (450, 270),
        [trials.starts.len(), Scene::ALL.len()],
        150,
        &key,
    );
    let scenes = Scene::ALL.into_iter();
    let panels = scenes.flat_map(|scene| trials.starts.iter().map(move |start| (start, scene)));
    let draw = |areas: &[Area]| {
        for (area, (start, scene)) in areas.iter().zip(panels) {
            dots_of(area, trials, start, scene)?;
        }
        Ok(())
    };
    Ok(Figure::new(
        "table1_trials",
        "Every simulated trial (dots), medians with their 95 % intervals (bars), and the printed errors of single runs (diamonds) \
                  on the side of the labels that the paper tells of. S 2018: Semantic-ICP as published in 2018; CW 2017: class by class, \
                  as published in 2017; CW Cauchy: those pairs under the loss that the paper prints. GICP-SE(3) does not look at labels.",
        svg(&layout, draw)?,
    ))
}

fn dots_of(area: &Area, trials: &Trials, start: &str, scene: Scene) -> Result<(), AnyError> {
    let methods = methods();
    let title = format!("{}, {}", scene.name(), in_words(start));
    let names: Vec<&str> = methods.iter().map(|method| letters(method)).collect();
    let xs = -0.6..methods.len() as f64 - 0.4;
    let mut chart = chart(
        area,
        &title,
        ("", xs),
        ("d_SE(3)", ERRORS.log_scale()),
        &names,
    )?;
    for (at, method) in methods.iter().enumerate() {
        for (side, (color, _)) in LABELS.into_iter().enumerate() {
            let q = if side == 0 { 0.0 } else { trials.bad };
            let x = at as f64 + 0.4 * side as f64 - 0.2;
            let of = trials.of_method(Some(scene), q, start, method);
            // Spread a little, so that dots are not upon each other.
            let spread = |i: usize| 0.07 * ((i * 7 % 5) as f64 / 2.0 - 1.0);
            chart.draw_series(of.enumerate().map(|(i, trial)| {
                let at = (x + spread(i), shown(trial.d_se3));
                Circle::new(at, 2, color.mix(0.45).filled())
            }))?;
            if let Some(estimate) = trials.d_se3(Some(scene), q, start, method) {
                let middle = shown(estimate.value);
                let mut lines = vec![vec![(x - 0.15, middle), (x + 0.15, middle)]];
                if let Some([low, high]) = estimate.interval {
                    lines.push(vec![(x, shown(low)), (x, shown(high))]);
                }
                let line = |points| PathElement::new(points, color.stroke_width(2));
                chart.draw_series(lines.into_iter().map(line))?;
            }
            let known = printed(scene).filter(|_| blamed(scene) == (side == 1));
            let value = known.and_then(|printed| match *method {
                GICP => Some(printed.gicp_se3),
                method if SEMANTIC.contains(&method) => Some(printed.semantic_icp),
                _ => None,
            });
            chart.draw_series(value.map(|value| {
                let outline = [(0, -6), (5, 0), (0, 6), (-5, 0), (0, -6)];
                EmptyElement::at((x, shown(value)))
                    + PathElement::new(outline.to_vec(), BLACK.stroke_width(2))
            }))?;
        }
    }
    Ok(())
}

/// Medians of all scenes by the share of wrong labels: a panel for each start.
pub(super) fn by_flips(trials: &Trials) -> Result<Figure, AnyError> {
    let key: Vec<_> = methods()
        .into_iter()
        .map(|method| (color(method), title(method)))
        .collect();
    let layout = Layout::new((430, 330), [trials.starts.len(), 1], 220, &key);
    let draw = |areas: &[Area]| {
        for (area, start) in areas.iter().zip(&trials.starts) {
            by_flips_from(area, trials, start)?;
        }
        Ok(())
    };
    Ok(Figure::new(
        "claim_by_labels",
        "Median d_SE(3) of all scenes with its 95 % interval, by the share of the view whose objects are labelled wrongly. \
                  GICP-SE(3), which does not look at labels, is the level.",
        svg(&layout, draw)?,
    ))
}

fn by_flips_from(area: &Area, trials: &Trials, start: &str) -> Result<(), AnyError> {
    let y = ("median d_SE(3)", ERRORS.log_scale());
    let title = format!("starts {}", in_words(start));
    let mut chart = chart(area, &title, ("share of wrong labels", -0.03..0.9), y, &[])?;
    for method in methods() {
        let color = color(method);
        let of = |q| Some((q, trials.d_se3(None, q, start, method)?));
        let points: Vec<(f64, Median)> = trials.flips().into_iter().filter_map(of).collect();
        let line = points.iter().map(|(q, e)| (*q, shown(e.value)));
        let width = if method == OURS { 3 } else { 2 };
        chart.draw_series(LineSeries::new(line.clone(), color.stroke_width(width)))?;
        chart.draw_series(line.map(|p| Circle::new(p, 3, color.filled())))?;
        let bars = points.iter().filter_map(|(q, e)| Some((*q, e.interval?)));
        chart.draw_series(bars.map(|(q, [low, high])| {
            let ends = vec![(q, shown(low)), (q, shown(high))];
            PathElement::new(ends, color.mix(0.6).stroke_width(1))
        }))?;
    }
    Ok(())
}
