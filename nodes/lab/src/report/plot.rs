//! Colours of the lattices, curves, and box plots.

use lattice_core::lattice::LatticeKind;
use plotters::prelude::*;

pub use super::picture::{Area, Layout, chart, svg};
use crate::AnyError;
use crate::evaluate::{median_interval, quantile};

/// Font at axes.
pub const LABELS: (&str, u32) = ("sans-serif", 13);

/// A lattice's colour, told apart by most eyes (Wong 2011).
pub fn color(kind: LatticeKind) -> RGBColor {
    match kind {
        LatticeKind::Cubic => BLACK,
        LatticeKind::Bcc => RGBColor(0, 114, 178),
        LatticeKind::Fcc => RGBColor(213, 94, 0),
        LatticeKind::Mcc => RGBColor(0, 158, 115),
        LatticeKind::Hex => RGBColor(230, 159, 0),
        LatticeKind::HexOptimal => RGBColor(204, 121, 167),
        LatticeKind::Custom => RGBColor(120, 120, 120),
    }
}

/// A lattice's name as people write it.
pub fn title(kind: LatticeKind) -> &'static str {
    match kind {
        LatticeKind::Cubic => "cubic",
        LatticeKind::Bcc => "BCC",
        LatticeKind::Fcc => "FCC",
        LatticeKind::Mcc => "MCC",
        LatticeKind::Hex => "hex",
        LatticeKind::HexOptimal => "hex, optimal",
        LatticeKind::Custom => "custom",
    }
}

/// Colours and names of lattices, for [`Layout::key`].
pub fn key(kinds: &[LatticeKind]) -> Vec<(RGBColor, &'static str)> {
    kinds
        .iter()
        .map(|&kind| (color(kind), title(kind)))
        .collect()
}

/// Title, axes and ranges of a panel.
#[derive(Clone, Debug)]
pub struct Axes<'a> {
    /// Title above it.
    pub title: &'a str,
    /// Name of x below it, with a unit.
    pub x: &'a str,
    /// Name of y at its left, with a unit.
    pub y: &'a str,
    /// Range of x.
    pub xs: std::ops::Range<f64>,
    /// Range of y.
    pub ys: std::ops::Range<f64>,
}

/// Number of labels at an axis, about.
const TICKS: usize = 7;

/// Labels of an axis that shows a range, with as many digits as they need.
pub fn labels(range: &std::ops::Range<f64>) -> impl Fn(&f64) -> String + use<> {
    let step = (range.end - range.start) / TICKS as f64;
    let digits = (-step.log10()).ceil().clamp(0.0, 9.0) as usize;
    move |value| {
        // No -0.
        let value = if value.abs() < step / 1e6 {
            0.0
        } else {
            *value
        };
        format!("{value:.digits$}")
    }
}

/// A line of a colour.
pub type Curve = (RGBColor, Vec<(f64, f64)>);

/// Lines in one panel.
pub fn curves(area: &Area, axes: &Axes, curves: &[Curve]) -> Result<(), AnyError> {
    let mut chart = ChartBuilder::on(area)
        .caption(axes.title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(axes.xs.clone(), axes.ys.clone())?;
    chart
        .configure_mesh()
        .x_desc(axes.x)
        .y_desc(axes.y)
        .x_labels(TICKS)
        .x_label_formatter(&labels(&axes.xs))
        .y_label_formatter(&labels(&axes.ys))
        .light_line_style(WHITE)
        .label_style(LABELS)
        .draw()?;
    for (color, points) in curves {
        chart.draw_series(LineSeries::new(
            points.iter().copied(),
            color.stroke_width(2),
        ))?;
    }
    Ok(())
}

/// Values from which a cumulative curve is drawn by its quantiles.
const MANY: usize = 200;

/// The share of values up to each of them: as steps, or as a line where they are many.
pub fn cumulative(values: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n > MANY {
        let at = |i: usize| {
            let value = sorted.get(i * (n - 1) / MANY)?;
            Some((*value, i as f64 / MANY as f64))
        };
        return (0..=MANY).filter_map(at).collect();
    }
    let steps = sorted.iter().enumerate();
    let share = |i: usize| i as f64 / n as f64;
    steps
        .flat_map(|(i, &x)| [(x, share(i)), (x, share(i + 1))])
        .collect()
}

/// Numbers of a box plot (Tukey 1977).
#[derive(Clone, PartialEq, Debug)]
pub struct BoxStats {
    /// Number of values.
    pub n: usize,
    /// Lower quartile.
    pub lower: f64,
    /// Median.
    pub median: f64,
    /// 95 % interval of the median.
    pub median_interval: [f64; 2],
    /// Upper quartile.
    pub upper: f64,
    /// The last values within 1.5 interquartile ranges of the box.
    pub whiskers: [f64; 2],
    /// Values beyond the whiskers, in order.
    pub outliers: Vec<f64>,
}

impl BoxStats {
    /// Numbers of the finite ones of some values; None of no values.
    pub fn of(values: &[f64]) -> Option<BoxStats> {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share| quantile(sorted.iter().copied(), share);
        let (lower, median, upper) = (at(0.25)?, at(0.5)?, at(0.75)?);
        let reach = 1.5 * (upper - lower);
        let within = |v: &f64| (lower - reach..=upper + reach).contains(v);
        let mut inside = sorted.iter().copied().filter(within);
        let low = inside.next().unwrap_or(lower);
        Some(BoxStats {
            n: sorted.len(),
            lower,
            median,
            median_interval: median_interval(sorted.iter().copied())?,
            upper,
            whiskers: [low, inside.next_back().unwrap_or(low)],
            outliers: sorted.iter().copied().filter(|v| !within(v)).collect(),
        })
    }
}

/// A box with its name and colour.
pub type NamedBox = (String, RGBColor, BoxStats);

/// Boxes beside each other: whiskers at 1.5 interquartile ranges, outliers as dots, the interval of the
/// median as a darker band. What lies above the panel is counted there. `axes.xs` is not used.
pub fn boxes(area: &Area, axes: &Axes, boxes: &[NamedBox]) -> Result<(), AnyError> {
    boxes_with_marks(area, axes, boxes, &[])
}

/// [`boxes`] with a cross at a value of each box, in their order.
pub fn boxes_with_marks(
    area: &Area,
    axes: &Axes,
    boxes: &[NamedBox],
    marks: &[Option<f64>],
) -> Result<(), AnyError> {
    let last = boxes.len() as f64 - 0.4;
    let mut chart = ChartBuilder::on(area)
        .caption(axes.title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(-0.6..last, axes.ys.clone())?;
    let name = |x: &f64| {
        let named = boxes.get(x.round().max(0.0) as usize);
        let on = (x - x.round()).abs() < 1e-6 && *x > -0.5;
        named.filter(|_| on).map_or(String::new(), |b| b.0.clone())
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(boxes.len() + 1)
        .x_label_formatter(&name)
        .y_label_formatter(&labels(&axes.ys))
        .x_desc(axes.x)
        .y_desc(axes.y)
        .light_line_style(WHITE)
        .label_style(LABELS)
        .draw()?;
    for (i, (_, color, stats)) in boxes.iter().enumerate() {
        let x = i as f64;
        let line = |points: Vec<(f64, f64)>| PathElement::new(points, color.stroke_width(2));
        let rectangle = |[low, high]: [f64; 2], fill: ShapeStyle| {
            Rectangle::new([(x - 0.28, low), (x + 0.28, high)], fill)
        };
        let ends = [stats.lower, stats.upper];
        chart.draw_series([
            rectangle(ends, color.mix(0.15).filled()),
            rectangle(stats.median_interval, color.mix(0.35).filled()),
            rectangle(ends, color.stroke_width(1)),
        ])?;
        let [low, high] = stats.whiskers;
        chart.draw_series([
            line(vec![(x - 0.28, stats.median), (x + 0.28, stats.median)]),
            line(vec![(x, stats.upper), (x, high)]),
            line(vec![(x, stats.lower), (x, low)]),
            line(vec![(x - 0.14, high), (x + 0.14, high)]),
            line(vec![(x - 0.14, low), (x + 0.14, low)]),
        ])?;
        let top = axes.ys.end;
        let (shown, above): (Vec<f64>, Vec<f64>) = stats.outliers.iter().partition(|v| **v <= top);
        let dots = shown.into_iter().filter(|v| *v >= axes.ys.start);
        chart.draw_series(dots.map(|v| Circle::new((x, v), 2, color.mix(0.5).filled())))?;
        if !above.is_empty() {
            let words = format!("{} above", above.len());
            let style = ("sans-serif", 12).into_font().color(color);
            chart.draw_series([Text::new(words, (x - 0.3, top), style)])?;
        }
    }
    let crosses = marks.iter().enumerate();
    let crosses = crosses.filter_map(|(i, mark)| Some((i as f64, (*mark)?)));
    chart.draw_series(crosses.map(|at| Cross::new(at, 6, BLACK.stroke_width(3))))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_those_of_tukey() {
        let values = [
            1.0,
            2.0,
            3.0,
            4.0,
            5.0,
            6.0,
            7.0,
            8.0,
            9.0,
            30.0,
            -20.0,
            f64::NAN,
        ];
        let stats = BoxStats::of(&values).unwrap();
        assert_eq!((stats.n, stats.median), (11, 5.0));
        assert_eq!((stats.lower, stats.upper), (2.5, 7.5));
        assert_eq!(stats.whiskers, [1.0, 9.0]);
        assert_eq!(stats.outliers, [-20.0, 30.0]);
        assert!(stats.median_interval[0] <= 5.0 && stats.median_interval[1] >= 5.0);
        assert_eq!(BoxStats::of(&[f64::NAN]), None);
        let one = BoxStats::of(&[2.0]).unwrap();
        assert_eq!((one.whiskers, one.outliers.len()), ([2.0, 2.0], 0));
    }

    #[test]
    fn labels_have_the_digits_that_they_need() {
        let said = |range, value: f64| labels(&range)(&value);
        assert_eq!(said(17_000.0..17_300.0, 17_100.0), "17100");
        assert_eq!(said(0.23..0.242, 0.234), "0.234");
        assert_eq!(
            (said(0.0..2.6, 0.5), said(-1.0..2.6, -1e-17)),
            ("0.5".into(), "0.0".into())
        );
    }

    #[test]
    fn a_cumulative_curve_goes_from_0_to_1() {
        let steps = cumulative(&[3.0, 1.0]);
        assert_eq!(steps, [(1.0, 0.0), (1.0, 0.5), (3.0, 0.5), (3.0, 1.0)]);
        let many: Vec<f64> = (0..=1000).rev().map(f64::from).collect();
        let line = cumulative(&many);
        assert!(line.len() <= 201 && line.iter().all(|(x, share)| x / 1000.0 == *share));
    }

    #[test]
    fn boxes_have_their_names_and_count_what_is_not_shown() {
        let layout = Layout {
            panel: (500, 300),
            columns: 1,
            rows: 1,
            key_width: 0,
            key: &[],
        };
        let axes = Axes {
            title: "errors",
            x: "lattice",
            y: "error (m)",
            xs: 0.0..1.0,
            ys: 0.0..10.0,
        };
        let mut values: Vec<f64> = (0..20).map(f64::from).map(|v| v / 10.0).collect();
        values.extend([9.0, 50.0, 60.0]);
        let stats = BoxStats::of(&values).unwrap();
        let named =
            LatticeKind::ALL.map(|kind| (title(kind).to_owned(), color(kind), stats.clone()));
        let picture = svg(&layout, |areas| boxes(&areas[0], &axes, &named)).unwrap();
        for kind in LatticeKind::ALL {
            let name = format!("\n{}\n", title(kind));
            assert_eq!(picture.matches(&name).count(), 1, "{name} in {picture}");
        }
        assert_eq!(picture.matches("2 above").count(), 6);
        assert_eq!(picture.matches("<circle").count(), 6);
    }
}
