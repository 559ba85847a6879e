//! Fig. 5 itself.

use super::turned_cloud::TurnedCloud;
use crate::AnyError;
use crate::evaluate::extent;
use crate::paper::voxels::scan::Scan;
use crate::report::Figure;
use crate::report::plot::{Curve, Layout, color, cumulative, curves, key, svg};
use lattice_core::lattice::LatticeKind;

/// Cumulative distributions of a cloud: a row for each kind of turns.
pub fn figure(scan: &Scan, runs: &[&TurnedCloud]) -> Result<Figure, AnyError> {
    let key = key(&LatticeKind::ALL);
    let layout = Layout::new((500, 310), [2, runs.len()], 130, &key);
    let picture = svg(&layout, |areas| {
        let panels = runs.iter().flat_map(|run| [(run, false), (run, true)]);
        for (area, (run, counts)) in areas.iter().zip(panels) {
            let line = |kind| {
                let measured = run.paper(kind)?;
                let values = match counts {
                    true => &measured.counts,
                    false => &measured.means_m,
                };
                Some((color(kind), cumulative(values)))
            };
            let lines: Vec<Curve> = LatticeKind::ALL.into_iter().filter_map(line).collect();
            let (what, x) = match counts {
                true => ("voxel count", "voxels"),
                false => ("distortion", "mean distance (m)"),
            };
            let name = format!("{what}, {}", run.turns.name());
            let y = ("share of poses", 0.0..1.0);
            curves(area, &name, (x, reach(&lines)), y, &lines)?;
        }
        Ok(())
    })?;
    Ok(Figure::new(
        format!("fig5_{}", scan.id),
        format!(
            "{} points, {}, cells of {} m³: share of {} poses with at most so much distortion (left) and so many voxels \
             (right).",
            scan.points.len(),
            scan.title,
            scan.volumes_m3.first().copied().unwrap_or(f64::NAN),
            runs.first()
                .and_then(|run| run.cubic())
                .map_or(0, |m| m.counts.len()),
        ),
        picture,
    ))
}

/// Range of x of some lines, and a little more.
fn reach(lines: &[Curve]) -> std::ops::Range<f64> {
    let xs = lines
        .iter()
        .flat_map(|(_, points)| points.iter().map(|p| p.0));
    let [low, high] = extent(xs);
    let room = 0.04 * (high - low).max(1e-9);
    low - room..high + room
}
