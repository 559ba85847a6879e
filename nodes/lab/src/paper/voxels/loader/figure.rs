//! Table I as a picture.

use lattice_core::lattice::LatticeKind;

use super::{Placed, Printed, rms_m};
use crate::AnyError;
use crate::evaluate::extent;
use crate::report::plot::{Area, Axes, BoxStats, Layout, NamedBox, boxes_with_marks, color, svg};

/// Voxels against the mean of cubic, and RMS: boxes over all places, crosses as printed.
pub fn draw(all: &[Placed]) -> Result<String, AnyError> {
    let layout = Layout {
        panel: (500, 350),
        columns: 2,
        rows: 1,
        key_width: 0,
        key: &[],
    };
    let mut cubic = all.iter();
    let cubic = cubic.find(|placed| placed.lattice.kind() == LatticeKind::Cubic);
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
        let name = placed.name().to_owned();
        Some((name, color(placed.lattice.kind()), stats))
    });
    let named: Vec<NamedBox> = named.collect();
    let marks: Vec<Option<f64>> = all.iter().map(|placed| placed.printed.map(mark)).collect();
    let shown = all
        .iter()
        .flat_map(values)
        .chain(marks.iter().copied().flatten());
    let [low, high] = extent(shown);
    let room = 0.06 * (high - low);
    let axes = Axes {
        title,
        x: "",
        y,
        xs: 0.0..1.0,
        ys: low - room..high + room,
    };
    boxes_with_marks(area, &axes, &named, &marks)
}
