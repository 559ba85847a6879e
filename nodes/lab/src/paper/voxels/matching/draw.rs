//! The pictures of Fig. 6.

use super::compare::{Estimate, change};
use super::group::Played;
use crate::AnyError;
use crate::report::plot::{Area, BoxStats, Layout, NamedBox, boxes, chart, color, svg, title};
use lattice_core::lattice::LatticeKind;
use plotters::prelude::*;

/// Changes up to this are shown, %.
const REACH: f64 = 45.0;
/// Panels beside each other.
const COLUMNS: usize = 2;

fn layout(panels: usize) -> Layout<'static> {
    Layout::new((560, 330), [COLUMNS, panels.div_ceil(COLUMNS)], 0, &[])
}

/// Box plots of the errors, a panel a scene.
pub(super) fn boxes_of(played: &[Played]) -> Result<String, AnyError> {
    svg(&layout(played.len()), |areas| {
        for (area, Played { scene, trials, .. }) in areas.iter().zip(played) {
            let mut named: Vec<NamedBox> = Vec::new();
            for (lattice, kind) in LatticeKind::ALL.into_iter().enumerate() {
                if let Some(stats) = BoxStats::of(&trials.errors_m(lattice)) {
                    named.push((title(kind), color(kind), stats));
                }
            }
            let whiskers = named.iter().map(|(_, _, stats)| stats.whiskers[1]);
            let top = 1.8 * whiskers.fold(0.0, f64::max);
            let y = ("position error (m)", 0.0..top.max(1e-6));
            boxes(area, &scene.title(), y, &named, &[])?;
        }
        Ok(())
    })
}

/// Changes against cubic with their intervals, a panel a scene.
pub(super) fn changes_of(played: &[Played]) -> Result<String, AnyError> {
    svg(&layout(played.len()), |areas| {
        for (area, one) in areas.iter().zip(played) {
            panel(area, one)?;
        }
        Ok(())
    })
}

fn panel(area: &Area, played: &Played) -> Result<(), AnyError> {
    let of = |share: usize, lattice: usize| change(&[&played.quantiles], share, lattice);
    let y = ("change against cubic (%)", -REACH..REACH);
    let names = LatticeKind::ALL.map(title);
    let mut chart = chart(area, &played.scene.title(), ("", 0.4..5.6), y, &names)?;
    let zero = PathElement::new(vec![(0.4, 0.0), (5.6, 0.0)], BLACK.stroke_width(1));
    chart.draw_series([zero])?;
    for (lattice, kind) in LatticeKind::ALL.into_iter().enumerate().skip(1) {
        for share in [0, 1] {
            let Estimate { value, low, high } = of(share, lattice);
            let [value, low, high] = [value, low, high].map(|v| v.clamp(-REACH, REACH));
            if ![value, low, high].iter().all(|v| v.is_finite()) {
                continue;
            }
            let x = lattice as f64 + 0.24 * (share as f64 - 0.5);
            let (color, line) = (color(kind), color(kind).stroke_width(2));
            chart.draw_series([PathElement::new(vec![(x, low), (x, high)], line)])?;
            let fill = if share == 0 { color } else { WHITE };
            chart.draw_series([
                Circle::new((x, value), 5, fill.filled()),
                Circle::new((x, value), 5, line),
            ])?;
        }
    }
    Ok(())
}
