//! Reliability of verdicts: probabilities and covariances as stated, against errors as observed.

use std::ops::Range;

use plotters::prelude::*;

use super::calibration_regression::CalibrationCurve;
use super::statistics::{Share, mean, median};
use super::trial::{Judged, OURS, Trial};
use crate::AnyError;
use crate::report::plot::{Layout, chart, svg};
use crate::report::{Cell, Figure, Report, Section, Table};

/// Errors beyond which a pose is one of another place: metres of the seen points, and degrees.
const ELSEWHERE: (f64, f64) = (0.5, 15.0);
/// Stated probabilities that are counted together.
const DECADES: [Range<f64>; 5] = [0.1..1.0, 1e-2..0.1, 1e-3..1e-2, 1e-4..1e-3, 0.0..1e-4];
/// Stated probabilities at which the curve of the odds is given.
const AT: [f64; 4] = [0.1, 0.01, 1e-3, 1e-4];
/// Share that is drawn for none, and where stated ones that are less are drawn.
const LEAST: f64 = 2e-5;
const STATED: RGBColor = RGBColor(0, 114, 178);
const TWICE: RGBColor = RGBColor(153, 153, 153);
/// Panels beside each other.
const COLUMNS: usize = 3;

/// Trials of one evaluation, with its name.
pub type Set = (String, Vec<Trial>);

/// Report of how often poses are wrong by the probability that was stated, and of the errors by the covariance.
pub fn reliability_report(sets: &[Set]) -> Result<Report, AnyError> {
    let (m, degrees) = ELSEWHERE;
    let lead = format!(
        "Poses found without a start, whatever their verdict. A pose is at another place if the seen points are {m} m from \
         where they should be on average, or it is turned by {degrees} degrees; shares with 95 % intervals. Probabilities are \
         those that this version states of the margins that were recorded."
    );
    let sections = vec![stated(sets)?, errors(sets)];
    let title = "Verdicts, stated and observed";
    Ok(Report::of_evaluation(title, lead, "reliability", sections))
}

/// Poses with what was said of them; clouds that belong nowhere are left out.
fn judged(trials: &[Trial]) -> impl Iterator<Item = (&Trial, &Judged, f64)> {
    let ours = trials
        .iter()
        .filter(|t| t.method == OURS && t.cell.start == "none");
    let somewhere = ours.filter(|t| !t.cell.scene.starts_with("wrong input/"));
    somewhere.filter_map(|t| {
        let judged = t.judged.as_ref()?;
        Some((t, judged, judged.p_wrong_by_margin()?))
    })
}

fn is_elsewhere(trial: &Trial) -> bool {
    trial.view_m > ELSEWHERE.0 || trial.rotation_deg > ELSEWHERE.1
}

/// A bin of stated probabilities: their mean, and the share that was wrong.
struct Bin {
    stated: f64,
    observed: Share,
}

impl Bin {
    fn of(sets: &[Set], range: &Range<f64>) -> Bin {
        let all = sets.iter().flat_map(|(_, trials)| judged(trials));
        let within: Vec<(&Trial, f64)> = all
            .filter(|(_, _, p)| range.contains(p))
            .map(|(trial, _, p)| (trial, p))
            .collect();
        let sum: f64 = within.iter().map(|(_, p)| p).sum();
        Bin {
            stated: sum / within.len().max(1) as f64,
            observed: Share::of(within.iter().map(|(trial, _)| is_elsewhere(trial))),
        }
    }

    /// Counts, and the mean that was stated; nothing of none.
    fn text(&self) -> String {
        let Share { k, n, .. } = self.observed;
        match n {
            0 => String::new(),
            _ => format!("{k} of {n}, stated {:.1e}", self.stated),
        }
    }
}

fn stated(sets: &[Set]) -> Result<Section, AnyError> {
    let line = |range: &Range<f64>| -> Vec<Cell> {
        let bin = Bin::of(sets, range);
        let mut cells = vec![
            format!("{} to {}", range.start, range.end).into(),
            format!("{:.1e}", bin.stated).into(),
            bin.observed.text(2).into(),
        ];
        let each = sets.chunks(1).map(|set| Bin::of(set, range).text());
        cells.extend(each.map(Cell::from));
        cells
    };
    let names: String = sets.iter().map(|(name, _)| format!("|{name}")).collect();
    let columns = format!("stated probability|its mean|at another place{names}");
    let title = "Probability that a pose is at another place";
    Ok(Section {
        figures: vec![diagram(sets)?],
        ..Section::of_table("stated", title, &columns, DECADES.iter().map(line))
            .with_table(odds(sets))
    })
}

/// Observed probabilities where some are stated, by a curve through all of them.
fn odds(sets: &[Set]) -> Table {
    let line = |name: &str, sets: &[Set]| -> Vec<Cell> {
        let all = sets.iter().flat_map(|(_, trials)| judged(trials));
        let outcomes: Vec<(f64, bool)> =
            all.map(|(trial, _, p)| (p, is_elsewhere(trial))).collect();
        let curve = CalibrationCurve::fit(&outcomes);
        let slope = curve.map(|curve| curve.slope());
        let mut cells = vec![name.into(), outcomes.len().into()];
        cells.push(slope.map_or("-".into(), |(b, sigma)| {
            format!("{b:.2} ± {sigma:.2}").into()
        }));
        cells.extend(AT.map(|p| match curve.map(|curve| curve.observed(p)) {
            Some([low, p, high]) => format!("{p:.1e} [{low:.1e}, {high:.1e}]").into(),
            None => Cell::from("-"),
        }));
        cells
    };
    let mut rows = vec![line("all", sets)];
    let each = sets.iter().zip(sets.chunks(1));
    rows.extend(each.map(|((name, _), set)| line(name, set)));
    let at: String = AT.iter().map(|p| format!("|where {p} is stated")).collect();
    let columns = format!("set|poses|slope{at}");
    let title = "Odds observed as a power of those stated (Cox 1958), all probabilities at once; 1 is the right slope";
    Table::new("odds", title, &columns, rows)
}

/// Observed share over the stated probability, of all sets and of each; a line where they are equal, and two where one
/// is twice the other.
fn diagram(sets: &[Set]) -> Result<Figure, AnyError> {
    let shown = |share: f64| share.clamp(LEAST, 1.0);
    let each = sets.iter().zip(sets.chunks(1));
    let each = each.map(|((name, _), set)| (name.as_str(), set));
    let panels: Vec<(&str, &[Set])> = std::iter::once(("all", sets)).chain(each).collect();
    let grid = [COLUMNS, panels.len().div_ceil(COLUMNS)];
    let key = [(STATED, "share, 95 %"), (TWICE, "equal, twice")];
    let picture = svg(&Layout::new((300, 280), grid, 130, &key), |areas| {
        for (area, (name, sets)) in areas.iter().zip(&panels) {
            let x = ("stated probability", (LEAST..1.0).log_scale());
            let y = ("share at another place", (LEAST..1.0).log_scale());
            let mut chart = chart(area, name, x, y, &[])?;
            for factor in [0.5, 1.0, 2.0] {
                let ends =
                    [LEAST.max(LEAST / factor), 1.0_f64.min(1.0 / factor)].map(|p| (p, factor * p));
                chart.draw_series(LineSeries::new(ends, TWICE))?;
            }
            for bin in DECADES.iter().map(|range| Bin::of(sets, range)) {
                let Some(share) = bin.observed.share else {
                    continue;
                };
                let x = shown(bin.stated);
                let ends = [bin.observed.low, bin.observed.high].map(|y| (x, shown(y)));
                chart.draw_series([PathElement::new(ends, STATED)])?;
                chart.draw_series([Circle::new((x, shown(share)), 4, STATED.filled())])?;
            }
        }
        Ok(())
    })?;
    let caption =
        "Share of poses at another place by the probability that was stated; right is the line";
    Ok(Figure::new("reliability", caption, picture))
}

fn errors(sets: &[Set]) -> Section {
    let line = |(name, trials): &Set| -> Vec<Cell> {
        let accepted = judged(trials).filter(|(trial, _, _)| trial.is_accepted());
        let nees: Vec<f64> = accepted.filter_map(|(_, judged, _)| judged.nees).collect();
        vec![
            name.as_str().into(),
            nees.len().into(),
            Cell::number(median(nees.iter().copied()), 1),
            Cell::number(mean(&nees), 1),
            Cell::number(nees.iter().copied().reduce(f64::max), 0),
        ]
    };
    let columns = "set|accepted|median NEES|mean NEES|largest";
    let title = "Normalised squared error of the accepted, 6 degrees of freedom: 6 is right on average, 5.3 in the median";
    let table = Table::new("nees", title, columns, sets.iter().map(line));
    Section::measured("nees", "Errors against the stated covariance", "").with_table(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::Cell as TrialCell;
    use nalgebra::{Isometry3, Point3};

    fn trial(scene: &str, off_m: f64, p_wrong: f64) -> Trial {
        let cell = TrialCell {
            scene: scene.to_owned(),
            seed: 0,
            q: 0.0,
            start: "none".to_owned(),
        };
        let (pose, truth) = (
            Isometry3::translation(off_m, 0.0, 0.0),
            Isometry3::identity(),
        );
        Trial {
            judged: Some(Judged {
                verdict: "OK".to_owned(),
                reason: String::new(),
                chosen: String::new(),
                margin: None,
                p_wrong: Some(p_wrong),
                even: None,
                chance: None,
                unexplained: None,
                places: None,
                scale: None,
                scale_gain: None,
                other_reading_ahead: None,
                fit: None,
                inliers: 1.0,
                nees: Some(4.0),
            }),
            ..Trial::of_pose(&cell, OURS, &pose, &truth, &[Point3::origin()], 0.0)
        }
    }

    #[test]
    fn poses_are_counted_where_their_probability_is() {
        let trials = [
            (9.0, 0.02),
            (0.1, 0.05),
            (0.1, 0.03),
            (0.1, 0.05),
            (0.1, 1e-9),
        ];
        let mut trials: Vec<Trial> = trials.map(|(off, p)| trial("desk", off, p)).into();
        // A cloud that belongs nowhere says nothing of places.
        trials.push(trial("wrong input/of another building", 9.0, 0.02));
        let report = reliability_report(&[("house".to_owned(), trials)]).unwrap();
        let text = crate::report::markdown(&report);
        assert!(
            text.contains("0.01 to 0.1 | 3.8e-2 | 25.00 % of 4"),
            "{text}"
        );
        assert!(text.contains("| 1 of 4, stated 3.8e-2"), "{text}");
        assert!(text.contains("house | 5 | 4.0 | 4.0 | 4"), "{text}");
    }
}
