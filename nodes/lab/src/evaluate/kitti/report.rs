//! The report of a comparison on laser scans.

use super::measure::{KittiReport, PairRow};
use crate::evaluate::median;
use crate::report::{Cell, Report, Section, Table};

/// A table with one line for each method and start. A refused pose is neither right nor wrong.
pub fn kitti_report(report: &KittiReport) -> Report {
    let mut rows = Vec::new();
    let mut done: Vec<(&str, &str)> = Vec::new();
    for row in &report.rows {
        let key = (row.method.as_str(), row.start.as_str());
        if !done.contains(&key) {
            done.push(key);
            let of = |r: &&PairRow| (r.method.as_str(), r.start.as_str()) == key;
            let same: Vec<_> = report.rows.iter().filter(of).collect();
            rows.push(line(row, &same));
        }
    }
    let columns = "method|start|right|wrong|refused|median error|largest error|\
        prepare + register, processor ms";
    let lead = format!(
        "{} ordered pairs of scans, thinned to the means of cells of {} m; a pose is right within {} m and {} degrees.",
        report.pairs.len(),
        report.cell_m,
        report.right_m,
        report.right_deg
    );
    let title = "Registration of labelled laser scans";
    let table = Table::new("kitti", "All methods and starts", columns, rows);
    let section = Section::measured("kitti", "Methods against the truth of an INS", "");
    let words = format!("kitti --cell {}", report.cell_m);
    Report::of_evaluation(title, lead, &words, vec![section.with_table(table)])
}

fn line(first: &PairRow, rows: &[&PairRow]) -> Vec<Cell> {
    let accepted = |row: &&&PairRow| row.verdict.as_deref().is_none_or(|v| v == "OK");
    let kept = rows.iter().filter(accepted).count();
    let right = rows.iter().filter(accepted).filter(|row| row.right).count();
    let middle = |of: fn(&PairRow) -> f64| median(rows.iter().map(|r| of(r))).unwrap_or(f64::NAN);
    let most = |of: fn(&PairRow) -> f64| rows.iter().map(|r| of(r)).fold(0.0, f64::max);
    let [prepare, register] = [middle(|r| r.prepare_ms), middle(|r| r.register_ms)];
    let error = |m: f64, deg: f64| Cell::Text(format!("{m:.3} m, {deg:.3} deg"));
    vec![
        first.title.as_str().into(),
        first.start.as_str().into(),
        format!("{right} of {}", rows.len()).into(),
        (kept - right).into(),
        match first.verdict {
            Some(_) => (rows.len() - kept).into(),
            None => "-".into(),
        },
        error(middle(|r| r.translation_m), middle(|r| r.rotation_deg)),
        error(most(|r| r.translation_m), most(|r| r.rotation_deg)),
        format!("{prepare:.0} + {register:.0}").into(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::markdown;

    fn row(right: bool, verdict: &str, translation_m: f64) -> PairRow {
        PairRow {
            method: "ours".to_owned(),
            title: "ours".to_owned(),
            start: "none".to_owned(),
            source: 0,
            target: 1,
            translation_m,
            rotation_deg: 0.1,
            right,
            verdict: Some(verdict.to_owned()),
            margin: None,
            prepare_ms: 1.0,
            register_ms: 2.0,
        }
    }

    #[test]
    fn a_refused_pose_is_not_a_right_one() {
        let report = KittiReport {
            rows: vec![
                row(true, "OK", 0.1),
                row(true, "AMBIGUOUS", 0.12),
                row(false, "OK", 5.0),
            ],
            ..KittiReport::default()
        };
        let table = markdown(&kitti_report(&report));
        let line =
            "| ours | none | 1 of 3 | 1 | 1 | 0.120 m, 0.100 deg | 5.000 m, 0.100 deg | 1 + 2 |";
        assert!(table.contains(line), "{table}");
    }
}
