//! Pictures of reports: panels side by side, charts in them, and a key of the colours.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use crate::AnyError;

/// An area of a picture.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A chart whose axes are of `X` and `Y`.
pub type Chart<'a, X, Y> = ChartContext<
    'a,
    SVGBackend<'a>,
    Cartesian2d<<X as AsRangedCoord>::CoordDescType, <Y as AsRangedCoord>::CoordDescType>,
>;

/// Panels in rows, and a key on their right.
#[derive(Clone, Copy, Debug)]
pub struct Layout<'a> {
    /// Size of one panel, pixels.
    pub panel: (u32, u32),
    /// Panels beside each other.
    pub columns: usize,
    /// Rows of panels.
    pub rows: usize,
    /// Width of the key, pixels.
    pub key_width: u32,
    /// Colours and their meanings.
    pub key: &'a [(RGBColor, &'a str)],
}

/// The picture as an `<svg>` element; `draw` gets its panels row by row.
pub fn svg(
    layout: &Layout,
    draw: impl FnOnce(&[Area]) -> Result<(), AnyError>,
) -> Result<String, AnyError> {
    let (columns, rows) = (layout.columns.max(1), layout.rows.max(1));
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

/// A chart with a title and named axes that fills a panel.
pub fn chart<'a, X, Y>(
    area: &Area<'a>,
    title: &str,
    (x, xs): (&str, X),
    (y, ys): (&str, Y),
) -> Result<Chart<'a, X, Y>, AnyError>
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(xs, ys)?;
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .light_line_style(WHITE)
        .draw()?;
    Ok(chart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_one_element_without_ids() {
        let layout = Layout {
            panel: (100, 50),
            columns: 2,
            rows: 3,
            key_width: 70,
            key: &[(BLUE, "a < b")],
        };
        let picture = svg(&layout, |areas| {
            assert_eq!(areas.len(), 6);
            for area in areas {
                let mut chart = ChartBuilder::on(area).build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
                chart.configure_mesh().draw()?;
            }
            Ok(())
        });
        let picture = picture.unwrap();
        assert!(
            picture.starts_with("<svg width=\"270\" height=\"150\""),
            "{picture}"
        );
        assert!(picture.trim_end().ends_with("</svg>") && picture.contains("a &lt; b"));
        assert!(!picture.contains(" id=") && !picture.contains("url("));
    }
}
