//! Figures of reports: panels with charts, curves and box plots, and a legend.

use lattice_core::lattice::LatticeKind;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use std::ops::Range;

use crate::AnyError;
use crate::evaluate::{median_interval, quantile};

/// Drawing area of a figure.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Chart with axes of types `X` and `Y`.
pub type Chart<'a, X, Y> = ChartContext<
    'a,
    SVGBackend<'a>,
    Cartesian2d<<X as AsRangedCoord>::CoordDescType, <Y as AsRangedCoord>::CoordDescType>,
>;
/// Colour and text of a legend entry.
pub type Key<'a> = (RGBColor, &'a str);

/// Panels of one size (pixels) in columns and rows, with a legend of `key_width` pixels on their right.
#[derive(Clone, Copy, Debug)]
pub struct Layout<'a> {
    panel: (u32, u32),
    grid: [usize; 2],
    key_width: u32,
    key: &'a [Key<'a>],
}

impl<'a> Layout<'a> {
    pub fn new(panel: (u32, u32), grid: [usize; 2], key_width: u32, key: &'a [Key<'a>]) -> Self {
        let grid = grid.map(|panels| panels.max(1));
        Layout {
            panel,
            grid,
            key_width,
            key,
        }
    }
}

/// Draws a figure as an `<svg>` element; `draw` gets the panels row by row.
pub fn svg(
    layout: &Layout,
    draw: impl FnOnce(&[Area]) -> Result<(), AnyError>,
) -> Result<String, AnyError> {
    let [columns, rows] = layout.grid;
    let width = layout.panel.0 * columns as u32;
    let size = (width + layout.key_width, layout.panel.1 * rows as u32);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE)?;
        let (left, right) = root.split_horizontally(width);
        for (row, (color, title)) in (0..).zip(layout.key) {
            let y = 40 + 18 * row;
            right.draw(&PathElement::new([(4, y), (24, y)], color.stroke_width(3)))?;
            right.draw(&Text::new(*title, (32, y - 6), ("sans-serif", 14)))?;
        }
        draw(&left.split_evenly((rows, columns)))?;
        root.present()?;
    }
    Ok(text)
}

/// Chart that fills a panel, with a title and named axes. The x axis has numbers, or the given names at 0, 1, 2 and
/// so on.
pub fn chart<'a, X, Y>(
    area: &Area<'a>,
    title: &str,
    (x, xs): (&str, X),
    (y, ys): (&str, Y),
    names: &[&str],
) -> Result<Chart<'a, X, Y>, AnyError>
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let name = |at: &f64| {
        let on = (at - at.round()).abs() < 1e-6 && *at > -0.5;
        let name = names.get(at.round().max(0.0) as usize).filter(|_| on);
        name.map_or(String::new(), |name| (*name).to_owned())
    };
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(xs, ys)?;
    let axes = chart.as_coord_spec();
    let (x_label, y_label) = (labels(axes.x_spec()), labels(axes.y_spec()));
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(x).y_desc(y).y_label_formatter(&y_label);
    match names.len() {
        0 => mesh.x_labels(TICKS).x_label_formatter(&x_label),
        n => (mesh.disable_x_mesh().x_labels(n + 1)).x_label_formatter(&name),
    };
    mesh.light_line_style(WHITE).label_style(("sans-serif", 13));
    mesh.draw()?;
    Ok(chart)
}

/// Approximate number of tick labels of an axis.
const TICKS: usize = 7;

/// Formatter of tick labels: all with the same number of digits, or each with its own on a logarithmic axis. Labels
/// have signs if zero is in the middle of the axis.
fn labels<A: Ranged<ValueType = f64>>(axis: &A) -> impl Fn(&f64) -> String + use<A> {
    let Range { start, end } = axis.range();
    let even = axis.map(&f64::midpoint(start, end), (0, 1000)) == 500;
    let step = (end - start) / TICKS as f64;
    let digits = (-step.log10()).ceil().clamp(0.0, 9.0) as usize;
    move |value| {
        // No -0.
        let value = (value * 1e6).round() / 1e6 + 0.0;
        match even {
            true if start == -end => format!("{value:+.digits$}"),
            true => format!("{value:.digits$}"),
            false => value.to_string(),
        }
    }
}

/// Colour of a lattice, from the colour-blind safe palette of Wong (2011).
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

/// Display name of a lattice.
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

/// Legend entries of lattices.
pub fn key(kinds: &[LatticeKind]) -> Vec<Key<'static>> {
    let of = |&kind: &LatticeKind| (color(kind), title(kind));
    kinds.iter().map(of).collect()
}

/// Colour and points of a curve.
pub type Curve = (RGBColor, Vec<(f64, f64)>);

/// Draws curves in a panel.
pub fn curves(
    area: &Area,
    title: &str,
    x: (&str, Range<f64>),
    y: (&str, Range<f64>),
    curves: &[Curve],
) -> Result<(), AnyError> {
    let mut chart = chart(area, title, x, y, &[])?;
    for (color, points) in curves {
        let points = points.iter().copied();
        chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
    }
    Ok(())
}

/// Number of values above which a cumulative curve is drawn by its quantiles.
const MANY: usize = 200;

/// Empirical cumulative distribution as points (value, fraction): a step function, or a polyline of 200 quantiles for
/// many values.
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

/// Statistics of a box plot (Tukey 1977).
#[derive(Clone, PartialEq, Debug)]
pub struct BoxStats {
    pub lower: f64,
    pub median: f64,
    /// 95 % confidence interval of the median.
    pub median_interval: [f64; 2],
    pub upper: f64,
    /// Smallest and largest value within 1.5 interquartile ranges of the box.
    pub whiskers: [f64; 2],
    /// Values beyond the whiskers, in ascending order.
    pub outliers: Vec<f64>,
}

impl BoxStats {
    /// Statistics of the finite values; `None` if there are none.
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
            lower,
            median,
            median_interval: median_interval(sorted.iter().copied())?,
            upper,
            whiskers: [low, inside.next_back().unwrap_or(low)],
            outliers: sorted.iter().copied().filter(|v| !within(v)).collect(),
        })
    }
}

/// Name, colour and statistics of a box.
pub type NamedBox = (&'static str, RGBColor, BoxStats);

/// Draws box plots side by side: whiskers at 1.5 interquartile ranges, outliers as dots, the confidence interval of
/// the median as a darker band, and a cross at the mark of a box. Values above the panel are counted at its top.
pub fn boxes(
    area: &Area,
    title: &str,
    (y, ys): (&str, Range<f64>),
    boxes: &[NamedBox],
    marks: &[Option<f64>],
) -> Result<(), AnyError> {
    let names: Vec<&str> = boxes.iter().map(|(name, ..)| *name).collect();
    let xs = -0.6..boxes.len() as f64 - 0.4;
    let mut chart = chart(area, title, ("", xs), (y, ys.clone()), &names)?;
    for (i, (_, color, stats)) in boxes.iter().enumerate() {
        let x = i as f64;
        let line = |from, to| PathElement::new(vec![from, to], color.stroke_width(2));
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
            line((x - 0.28, stats.median), (x + 0.28, stats.median)),
            line((x, stats.upper), (x, high)),
            line((x, stats.lower), (x, low)),
            line((x - 0.14, high), (x + 0.14, high)),
            line((x - 0.14, low), (x + 0.14, low)),
        ])?;
        let (shown, above): (Vec<f64>, Vec<f64>) =
            stats.outliers.iter().partition(|v| **v <= ys.end);
        let dots = shown.into_iter().filter(|v| *v >= ys.start);
        chart.draw_series(dots.map(|v| Circle::new((x, v), 2, color.mix(0.5).filled())))?;
        if !above.is_empty() {
            let words = format!("{} above", above.len());
            let style = ("sans-serif", 12).into_font().color(color);
            chart.draw_series([Text::new(words, (x - 0.3, ys.end), style)])?;
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
    use plotters::coord::types::RangedCoordf64;

    #[test]
    fn a_picture_is_one_element_without_ids() {
        let layout = Layout::new((100, 50), [2, 3], 70, &[(BLUE, "a < b")]);
        let picture = svg(&layout, |areas| {
            assert_eq!(areas.len(), 6);
            curves(&areas[5], "", ("", 0.0..1.0), ("", 0.0..1.0), &[])
        });
        let picture = picture.unwrap();
        let size = "<svg width=\"270\" height=\"150\"";
        assert!(picture.starts_with(size), "{picture}");
        assert!(picture.trim_end().ends_with("</svg>") && picture.contains("a &lt; b"));
        assert!(!picture.contains(" id=") && !picture.contains("url("));
    }

    #[test]
    fn boxes_are_those_of_tukey() {
        let mut values: Vec<f64> = (1..10).map(f64::from).collect();
        values.extend([30.0, -20.0, f64::NAN]);
        let stats = BoxStats::of(&values).unwrap();
        assert_eq!((stats.lower, stats.median, stats.upper), (2.5, 5.0, 7.5));
        assert_eq!(stats.whiskers, [1.0, 9.0]);
        assert_eq!(stats.outliers, [-20.0, 30.0]);
        assert!(stats.median_interval[0] <= 5.0 && stats.median_interval[1] >= 5.0);
        assert_eq!(BoxStats::of(&[f64::NAN]), None);
        let one = BoxStats::of(&[2.0]).unwrap();
        assert_eq!((one.whiskers, one.outliers.len()), ([2.0, 2.0], 0));
    }

    #[test]
    fn labels_have_the_digits_that_they_need() {
        let of = |range: Range<f64>, value| labels(&RangedCoordf64::from(range))(&value);
        assert_eq!(of(0.0..1.0, 0.0) + &of(0.0..1.0, 0.3 - 0.1), "0.00.2");
        assert_eq!(of(17_100.0..18_300.0, 17_100.0), "17100");
        assert_eq!(
            [0.0, -1e-17, 10.0].map(|value| of(-45.0..45.0, value)),
            ["+0", "+0", "+10"]
        );
        let errors = labels(&LogCoord::<f64>::from((0.005..30.0).log_scale()));
        assert_eq!([0.01, 10.0].map(|value| errors(&value)), ["0.01", "10"]);
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
        let mut values: Vec<f64> = (0..20).map(f64::from).map(|v| v / 10.0).collect();
        values.extend([9.0, 50.0, 60.0]);
        let stats = BoxStats::of(&values).unwrap();
        let named = LatticeKind::ALL.map(|kind| (title(kind), color(kind), stats.clone()));
        let layout = Layout::new((500, 300), [1, 1], 0, &[]);
        let draw = |areas: &[Area]| boxes(&areas[0], "", ("error (m)", 0.0..10.0), &named, &[]);
        let picture = svg(&layout, draw).unwrap();
        for kind in LatticeKind::ALL {
            let name = format!("\n{}\n", title(kind));
            assert_eq!(picture.matches(&name).count(), 1, "{name} in {picture}");
        }
        assert_eq!(picture.matches("2 above").count(), 6);
        assert_eq!(picture.matches("<circle").count(), 6);
    }
}
