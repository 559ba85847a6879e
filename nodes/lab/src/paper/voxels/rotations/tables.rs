//! The numbers of Fig. 5.

use super::measure::Laid;
use super::turned_cloud::{ROUND, TurnedCloud};
use crate::evaluate::Share;
use crate::paper::estimate::Estimate;
use crate::report::{Cell, Table};
use lattice_core::lattice::LatticeKind;

/// "-5.0 ± 0.1".
fn percent(change: Estimate) -> Cell {
    let [mean, half] = [change.mean, change.half].map(|value| 100.0 * value);
    Cell::Text(format!("{mean:+.2} ± {half:.2}"))
}

/// A row for each run: the change of the count, lattice by lattice.
pub fn summary(runs: &[TurnedCloud]) -> Table {
    let others = LatticeKind::ALL.into_iter().skip(1).map(Laid::paper);
    let laid: Vec<Laid> = others.chain(ROUND.map(Laid::flat)).collect();
    let row = |run: &TurnedCloud| {
        let cubic = run.cubic();
        let count = cubic.map(|cubic| Estimate::of(cubic.counts.iter().copied()).mean);
        let mut row = vec![
            Cell::Text(run.scan.title.clone()),
            run.turns.name().into(),
            Cell::Number(run.volume_m3, 3),
            count.map_or(Cell::Empty, |count| Cell::Number(count, 0)),
        ];
        row.extend(laid.iter().map(|laid| {
            let change = cubic.and_then(|cubic| Some(run.of(*laid)?.count_to(cubic)));
            change.map_or(Cell::Empty, percent)
        }));
        row
    };
    let mut columns = "points|turned by|cell volume (m³)|voxels, cubic".to_owned();
    columns.extend(laid.iter().map(|laid| format!("|{} (%)", laid.name())));
    Table::new(
        "fig5_counts",
        "Voxel count against cubic at the same poses, mean with 95 % interval",
        &columns,
        runs.iter().map(row),
    )
}

/// A row for each lattice of each run.
pub fn details(runs: &[TurnedCloud]) -> Table {
    let columns = "points|turned by|cell volume (m³)|lattice|poses|voxels|±|to cubic (%)|±|std of voxels|\
        ±|std to cubic|mean distance (m)|to cubic (%)|±|poses at which cubic takes fewer (%)|\
        95 % interval";
    let mut rows = Vec::new();
    for run in runs {
        let Some(cubic) = run.cubic() else {
            continue;
        };
        for measured in &run.measured {
            let mut row: Vec<Cell> = vec![
                Cell::Text(run.scan.title.clone()),
                run.turns.name().into(),
                Cell::Number(run.volume_m3, 3),
                Cell::Text(measured.laid.name()),
                measured.counts.len().into(),
            ];
            row.extend(Estimate::of(measured.counts.iter().copied()).cells(1.0, 1));
            row.extend(measured.count_to(cubic).cells(100.0, 2));
            row.extend(measured.spread().cells(1.0, 1));
            row.push(Cell::Number(
                measured.spread().mean / cubic.spread().mean,
                3,
            ));
            let mean = Estimate::of(measured.means_m.iter().copied()).mean;
            row.push(Cell::Number(mean, 5));
            row.extend(measured.mean_to(cubic).cells(100.0, 2));
            let rare = Share::of(measured.more_than(cubic));
            row.push(Cell::Number(100.0 * rare.share.unwrap_or(f64::NAN), 1));
            let interval = format!("{:.1} to {:.1}", 100.0 * rare.low, 100.0 * rare.high);
            row.push(Cell::Text(interval));
            rows.push(row);
        }
    }
    Table::new(
        "fig5",
        "All lattices on all clouds, with 95 % intervals",
        columns,
        rows,
    )
}
