//! Table I as a picture.

use super::placed::{Placed, Printed, find, rms_m};
use crate::AnyError;
use crate::evaluate::extent;
use crate::report::plot::{Area, BoxStats, Layout, NamedBox, boxes, color, svg};
use lattice_core::lattice::LatticeKind;

/// Voxels against the mean of cubic, and RMS: boxes over all places, crosses as printed.
pub fn draw(all: &[Placed]) -> Result<String, AnyError> {
    let layout = Layout::new((500, 350), [2, 1], 0, &[]);
    let cubic = find(all, LatticeKind::Cubic);
    let voxels = cubic.map_or(f64::NAN, |placed| placed.voxels().mean);
    let printed = cubic.and_then(|placed| placed.printed);
    let printed_voxels = printed.map_or(f64::NAN, |row| row.voxels);
    svg(&layout, |areas| {
        let [left, right] = areas else {
            return Ok(());
        };
        let change = |count: f64, of: f64| 100.0 * (count / of - 1.0);
        let count = |placed: &Placed| placed.each(|q| change(q.voxels as f64, voxels));
        let mark = |row: &Printed| change(row.voxels, printed_voxels);
        let words = ("voxels to cubic", "change (%)");
        panel(left, words, all, &count, &mark)?;
        let rms = |placed: &Placed| placed.each(rms_m);
        let words = ("RMS, printed as \"distance error\"", "RMS (m)");
        panel(right, words, all, &rms, &|row| row.distance_error)
    })
}

fn panel(
    area: &Area,
    (title, y): (&str, &str),
    all: &[Placed],
    values: &dyn Fn(&Placed) -> Vec<f64>,
    mark: &dyn Fn(&Printed) -> f64,
) -> Result<(), AnyError> {
    let named = all.iter().filter_map(|placed| {
        let stats = BoxStats::of(&values(placed))?;
        Some((placed.name(), color(placed.lattice.kind()), stats))
    });
    let named: Vec<NamedBox> = named.collect();
    let marks = all.iter().map(|placed| placed.printed.as_ref().map(mark));
    let marks: Vec<Option<f64>> = marks.collect();
    let shown = all.iter().flat_map(values);
    let [low, high] = extent(shown.chain(marks.iter().copied().flatten()));
    let room = 0.06 * (high - low);
    boxes(area, title, (y, low - room..high + room), &named, &marks)
}
