//! Fig. 1: the Voronoi cells, drawn.

use super::report_options::Options;
use crate::AnyError;
use crate::report::plot::{color, title};
use crate::report::{Cell, Check, Figure, Section, Table, Verdict, numbers};
use crate::theory::surface_m2;
use lattice_core::lattice::{Lattice, LatticeKind};
use nalgebra::Vector3;
use plotters::style::RGBColor;
use std::fmt::Write;

/// A polyhedron: its lattice, number of corners, numbers of corners of a face and how many faces have
/// them, and its name.
type Shape = (LatticeKind, usize, &'static [(usize, usize)], &'static str);

/// The polyhedra that the paper names, and ours.
const SHAPES: [Shape; 6] = [
    (LatticeKind::Cubic, 8, &[(4, 6)], "cube"),
    (LatticeKind::Bcc, 24, CUT, "truncated octahedron"),
    (LatticeKind::Fcc, 14, &[(4, 12)], "rhombic dodecahedron"),
    (LatticeKind::Mcc, 24, CUT, STRETCHED),
    (LatticeKind::Hex, 12, PRISM, "hexagonal prism"),
    (LatticeKind::HexOptimal, 12, PRISM, BEST_PRISM),
];
const CUT: &[(usize, usize)] = &[(4, 6), (6, 8)];
const PRISM: &[(usize, usize)] = &[(4, 6), (6, 2)];
const STRETCHED: &str = "MCC cell, a stretched truncated octahedron";
const BEST_PRISM: &str = "hexagonal prism of least squared error";

/// Size of a picture of one cell, pixels.
const TILE: f64 = 240.0;
/// Pixels of a cell side.
const SCALE: f64 = 105.0;
/// Room for its name, pixels.
const NAME: f64 = 44.0;

pub fn section(_: &Options, _: &mut dyn FnMut(f64)) -> Result<Section, AnyError> {
    let mut checks = Vec::new();
    let mut rows = Vec::new();
    for (kind, corners, faces, shape) in SHAPES {
        let lattice = Lattice::new(kind, 1.0)?;
        let cell = lattice.cell();
        let name = title(kind);
        let volume = format!("{name}: volume");
        checks.push(Check::new(volume, 1.0, cell.volume_m3(), 1e-12));
        let mut count = |what: String, expected: usize, found: usize| {
            checks.push(Check::count(format!("{name}: {what}"), expected, found));
        };
        count("corners".into(), corners, cell.vertices.len());
        let all = faces.iter().map(|(_, count)| count).sum();
        count("faces".into(), all, cell.faces.len());
        for &(sides, expected) in faces {
            let of = cell.faces.iter().filter(|f| f.vertices.len() == sides);
            count(format!("faces of {sides} corners"), expected, of.count());
        }
        let radii = [lattice.covering_radius_m(), lattice.packing_radius_m()];
        let mut row = vec![name.into(), shape.into()];
        row.extend([cell.vertices.len(), cell.faces.len()].map(Cell::from));
        row.extend(numbers(6, radii));
        row.push(Cell::Number(surface_m2(&lattice), 5));
        rows.push(row);
    }
    let columns = "lattice|cell|corners|faces|farthest point (cell sides)|nearest face (cell sides)|\
        surface (sides²)";
    Ok(Section {
        id: "fig1".into(),
        title: "Fig. 1: Voronoi cells".into(),
        claim: "The cells are the cube, the truncated octahedron (BCC), the rhombic dodecahedron (FCC), the MCC \
                cell and the hexagonal prism."
            .into(),
        finding: "So they are, each of volume 1. We add the prism of least squared error, a little taller than the \
                  paper's."
            .into(),
        verdict: Verdict::Reproduced,
        checks,
        tables: vec![Table::new("fig1", "The cells, of unit volume", columns, rows)],
        figures: vec![Figure::new("fig1", "Voronoi cells of equal volume, seen from the same direction, axes as in eq. (8)-(12), z up.", draw()?)],
    })
}

/// All cells beside each other, shaded by the light from the upper left.
fn draw() -> Result<String, AnyError> {
    let columns = 3;
    let rows = SHAPES.len().div_ceil(columns);
    let (width, height) = (TILE * columns as f64, (TILE + NAME) * rows as f64);
    let mut svg = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         xmlns=\"http://www.w3.org/2000/svg\">\n"
    );
    for (i, (kind, _, _, shape)) in SHAPES.into_iter().enumerate() {
        let x = TILE * ((i % columns) as f64 + 0.5);
        let y = (TILE + NAME) * (i / columns) as f64 + TILE / 2.0;
        draw_cell(&mut svg, &Lattice::new(kind, 1.0)?, x, y)?;
        let short = shape.split(',').next().unwrap_or(shape);
        writeln!(
            svg,
            "<text x=\"{x}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"15\" font-weight=\"bold\" \
             text-anchor=\"middle\">{}</text>\n<text x=\"{x}\" y=\"{}\" font-family=\"sans-serif\" \
             font-size=\"12\" text-anchor=\"middle\" fill=\"#444\">{short}</text>",
            y + TILE / 2.0 + 8.0,
            title(kind),
            y + TILE / 2.0 + 26.0,
        )?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// An orthographic view: the faces that look at the eye, edges on top.
fn draw_cell(svg: &mut String, lattice: &Lattice, x: f64, y: f64) -> Result<(), AnyError> {
    let eye = Vector3::new(0.80, -0.52, 0.42).normalize();
    let right = Vector3::z().cross(&eye).normalize();
    let up = eye.cross(&right);
    let light = (eye * 0.35 - right * 0.45 + up * 0.75).normalize();
    let RGBColor(r, g, b) = color(lattice.kind());
    for face in &lattice.cell().faces {
        let normal = lattice.center(face.neighbor).normalize();
        if normal.dot(&eye) <= 1e-9 {
            continue;
        }
        let shade = 0.2 + 0.75 * normal.dot(&light).max(0.0);
        // From a dark tone of the colour to a light one.
        let fill = [r, g, b].map(|c| format!("{:.0}", 0.35 * f64::from(c) + 45.0 + 120.0 * shade));
        let fill = fill.join(",");
        let corners = lattice.cell().polygon(face).map(|corner| {
            let (across, high) = (corner.dot(&right), corner.dot(&up));
            format!("{:.2},{:.2}", x + SCALE * across, y - SCALE * high)
        });
        writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"rgb({fill})\" stroke=\"rgb({r},{g},{b})\" \
             stroke-width=\"1.6\" stroke-linejoin=\"round\"/>",
            corners.collect::<Vec<_>>().join(" ")
        )?;
    }
    Ok(())
}
