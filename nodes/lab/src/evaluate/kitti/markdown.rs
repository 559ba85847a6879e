//! The table.

use std::fmt::Write;

use super::{KittiReport, PairRow};
use crate::evaluate::median;

/// One line for each method and start. What a method refuses is neither right nor wrong.
pub fn kitti_markdown(report: &KittiReport) -> String {
    let mut text = String::from(
        "| method | start | right | wrong | refused | median error | largest error | prepare + register, processor ms |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    let mut done: Vec<(&str, &str)> = Vec::new();
    for row in &report.rows {
        let key = (row.method.as_str(), row.start.as_str());
        if !done.contains(&key) {
            done.push(key);
            let of = |r: &&PairRow| (r.method.as_str(), r.start.as_str()) == key;
            let rows: Vec<&PairRow> = report.rows.iter().filter(of).collect();
            line(&mut text, row, &rows);
        }
    }
    text
}

fn line(text: &mut String, first: &PairRow, rows: &[&PairRow]) {
    let accepted = |row: &&&PairRow| row.verdict.as_deref().is_none_or(|v| v == "OK");
    let kept = rows.iter().filter(accepted).count();
    let right = rows.iter().filter(accepted).filter(|row| row.right).count();
    let wrong = kept - right;
    let refused = match first.verdict {
        Some(_) => (rows.len() - kept).to_string(),
        None => "-".to_owned(),
    };
    let middle = |of: fn(&PairRow) -> f64| median(rows.iter().map(|r| of(r))).unwrap_or(f64::NAN);
    let most = |of: fn(&PairRow) -> f64| rows.iter().map(|r| of(r)).fold(0.0, f64::max);
    // Nothing fails in writing to a string.
    let _ = writeln!(
        text,
        "| {} | {} | {right} of {} | {wrong} | {refused} | {:.3} m, {:.3} deg | {:.3} m, {:.3} deg | {:.0} + {:.0} |",
        first.title,
        first.start,
        rows.len(),
        middle(|r| r.translation_m),
        middle(|r| r.rotation_deg),
        most(|r| r.translation_m),
        most(|r| r.rotation_deg),
        middle(|r| r.prepare_ms),
        middle(|r| r.register_ms),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

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
            cell_m: 0.3,
            build: "dev".to_owned(),
            threads: 1,
            right_m: 0.15,
            right_deg: 0.3,
            scans: Vec::new(),
            points: Vec::new(),
            pairs: Vec::new(),
            rows: vec![
                row(true, "OK", 0.1),
                row(true, "AMBIGUOUS", 0.12),
                row(false, "OK", 5.0),
            ],
        };
        let table = kitti_markdown(&report);
        let line =
            "| ours | none | 1 of 3 | 1 | 1 | 0.120 m, 0.100 deg | 5.000 m, 0.100 deg | 1 + 2 |";
        assert!(table.contains(line), "{table}");
    }
}
