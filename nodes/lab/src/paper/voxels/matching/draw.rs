//! The pictures of Fig. 6.

use lattice_core::lattice::LatticeKind;
use plotters::prelude::*;

use super::Played;
use super::compare::{Estimate, change};
use crate::AnyError;
use crate::report::plot::{
    Area, Axes, BoxStats, LABELS, Layout, NamedBox, boxes, color, svg, title,
};

/// Changes up to this are shown, %.
const REACH: f64 = 45.0;
/// Panels beside each other.
const COLUMNS: usize = 2;

fn layout(panels: usize) -> Layout<'static> {
    Layout {
        panel: (560, 330),
        columns: COLUMNS,
        rows: panels.div_ceil(COLUMNS),
        key_width: 0,
        key: &[],
    }
}

/// Box plots of the errors, a panel a scene.
pub(super) fn boxes_of(played: &[Played]) -> Result<String, AnyError> {
    svg(&layout(played.len()), |areas| {
        for (area, Played { scene, trials, .. }) in areas.iter().zip(played) {
            let mut named: Vec<NamedBox> = Vec::new();
            for (lattice, kind) in LatticeKind::ALL.into_iter().enumerate() {
                if let Some(stats) = BoxStats::of(&trials.errors_m(lattice)) {
                    named.push((title(kind).to_owned(), color(kind), stats));
                }
            }
            let whiskers = named.iter().map(|(_, _, stats)| stats.whiskers[1]);
            let top = 1.8 * whiskers.fold(0.0, f64::max);
            let axes = Axes {
                title: &scene.title(),
                x: "",
                y: "position error (m)",
                xs: 0.0..1.0,
                ys: 0.0..top.max(1e-6),
            };
            boxes(area, &axes, &named)?;
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
    let others = || LatticeKind::ALL.into_iter().enumerate().skip(1);
    let name = |x: &f64| {
        let near = others().find(|(lattice, _)| (x - *lattice as f64).abs() < 1e-6);
        near.map_or(String::new(), |(_, kind)| title(kind).to_owned())
    };
    let of = |share: usize, lattice: usize| change(&[&played.quantiles], share, lattice);
    let mut chart = ChartBuilder::on(area)
        .caption(played.scene.title(), ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(0.4..5.6, -REACH..REACH)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(7)
        .x_label_formatter(&name)
        .y_label_formatter(&|percent| format!("{percent:+.0}"))
        .y_desc("change against cubic (%)")
        .light_line_style(WHITE)
        .label_style(LABELS)
        .draw()?;
    let zero = PathElement::new(vec![(0.4, 0.0), (5.6, 0.0)], BLACK.stroke_width(1));
    chart.draw_series([zero])?;
    for (lattice, kind) in others() {
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
