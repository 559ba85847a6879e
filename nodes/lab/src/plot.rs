//! What the pictures of reports share: panels side by side, and a key of what the colours mean.

use std::error::Error;

use plotters::coord::Shift;
use plotters::prelude::*;

/// Why nothing was drawn.
pub type Fault = Box<dyn Error + Send + Sync>;
/// Where something can be drawn.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

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
    /// What the colours mean.
    pub key: &'a [(RGBColor, &'a str)],
}

impl Layout<'_> {
    /// Of the whole picture, pixels.
    pub fn size(&self) -> (u32, u32) {
        let (columns, rows) = (self.columns.max(1) as u32, self.rows.max(1) as u32);
        (self.panel.0 * columns + self.key_width, self.panel.1 * rows)
    }
}

/// Draws the key on a picture of [`Layout::size`]; the whole picture, and its panels row by row.
pub fn panels<'a>(
    backend: SVGBackend<'a>,
    layout: &Layout,
) -> Result<(Area<'a>, Vec<Area<'a>>), Fault> {
    let root = backend.into_drawing_area();
    root.fill(&WHITE)?;
    let (columns, rows) = (layout.columns.max(1), layout.rows.max(1));
    let (left, right) = root.split_horizontally(layout.panel.0 * columns as u32);
    for (row, (color, title)) in (0..).zip(layout.key) {
        let y = 40 + 18 * row;
        right.draw(&PathElement::new([(4, y), (24, y)], color.stroke_width(3)))?;
        right.draw(&Text::new(*title, (32, y - 6), ("sans-serif", 14)))?;
    }
    Ok((root, left.split_evenly((rows, columns))))
}

/// The picture as an `<svg>` element.
pub fn svg(
    layout: &Layout,
    draw: impl FnOnce(&[Area]) -> Result<(), Fault>,
) -> Result<String, Fault> {
    let mut text = String::new();
    {
        let backend = SVGBackend::with_string(&mut text, layout.size());
        let (root, areas) = panels(backend, layout)?;
        draw(&areas)?;
        root.present()?;
    }
    Ok(text)
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
