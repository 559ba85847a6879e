//! Fig. 1: the Voronoi cells, drawn.

use std::fmt::Write;

use lattice_core::lattice::{Lattice, LatticeKind};
use nalgebra::Vector3;

use super::{Options, unit};
use crate::AnyError;
use crate::report::plot::{color, title};
use crate::report::{Cell, Check, Figure, Section, Table, Verdict};
use crate::theory::surface_m2;

/// Corners and faces of a named polyhedron.
struct Shape {
    kind: LatticeKind,
    name: &'static str,
    corners: usize,
    /// Numbers of corners, and how many faces have them.
    faces: &'static [(usize, usize)],
}

/// The polyhedra that the paper names, and ours.
const SHAPES: [Shape; 6] = [
    Shape {
        kind: LatticeKind::Cubic,
        name: "cube",
        corners: 8,
        faces: &[(4, 6)],
    },
    Shape {
        kind: LatticeKind::Bcc,
        name: "truncated octahedron",
        corners: 24,
        faces: &[(4, 6), (6, 8)],
    },
    Shape {
        kind: LatticeKind::Fcc,
        name: "rhombic dodecahedron",
        corners: 14,
        faces: &[(4, 12)],
    },
    Shape {
        kind: LatticeKind::Mcc,
        name: "MCC cell, a stretched truncated octahedron",
        corners: 24,
        faces: &[(4, 6), (6, 8)],
    },
    Shape {
        kind: LatticeKind::Hex,
        name: "hexagonal prism",
        corners: 12,
        faces: &[(4, 6), (6, 2)],
    },
    Shape {
        kind: LatticeKind::HexOptimal,
        name: "hexagonal prism of least squared error",
        corners: 12,
        faces: &[(4, 6), (6, 2)],
    },
];

/// Size of a picture of one cell, pixels.
const TILE: f64 = 240.0;
/// Pixels of a cell side.
const SCALE: f64 = 105.0;
/// Room for its name, pixels.
const NAME: f64 = 44.0;

pub fn section(_: &Options, _: &mut dyn FnMut(f64)) -> Result<Section, AnyError> {
    let mut checks = Vec::new();
    let mut rows = Vec::new();
    for shape in SHAPES {
        let kind = shape.kind;
        let lattice = unit(kind)?;
        let cell = lattice.cell();
        let name = title(kind);
        let mut check = |what: String, expected: f64, found: f64, tolerance: f64| {
            checks.push(Check::new(
                format!("{name}: {what}"),
                expected,
                found,
                tolerance,
            ));
        };
        check("volume".into(), 1.0, cell.volume_m3(), 1e-12);
        check(
            "corners".into(),
            shape.corners as f64,
            cell.vertices.len() as f64,
            0.0,
        );
        let all: usize = shape.faces.iter().map(|(_, count)| count).sum();
        check("faces".into(), all as f64, cell.faces.len() as f64, 0.0);
        for &(sides, count) in shape.faces {
            let found = cell
                .faces
                .iter()
                .filter(|f| f.vertices.len() == sides)
                .count();
            check(
                format!("faces of {sides} corners"),
                count as f64,
                found as f64,
                0.0,
            );
        }
        rows.push(vec![
            name.into(),
            shape.name.into(),
            cell.vertices.len().into(),
            cell.faces.len().into(),
            Cell::Number(lattice.covering_radius_m(), 6),
            Cell::Number(lattice.packing_radius_m(), 6),
            Cell::Number(surface_m2(&lattice), 5),
        ]);
    }
    let columns = [
        "lattice",
        "cell",
        "corners",
        "faces",
        "farthest point (cell sides)",
        "nearest face (cell sides)",
        "surface (sides²)",
    ];
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
    for (i, shape) in SHAPES.into_iter().enumerate() {
        let x = TILE * ((i % columns) as f64 + 0.5);
        let y = (TILE + NAME) * (i / columns) as f64 + TILE / 2.0;
        draw_cell(&mut svg, &unit(shape.kind)?, x, y)?;
        let short = shape.name.split(',').next().unwrap_or(shape.name);
        writeln!(
            svg,
            "<text x=\"{x}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"15\" font-weight=\"bold\" \
             text-anchor=\"middle\">{}</text>\n<text x=\"{x}\" y=\"{}\" font-family=\"sans-serif\" \
             font-size=\"12\" text-anchor=\"middle\" fill=\"#444\">{short}</text>",
            y + TILE / 2.0 + 8.0,
            title(shape.kind),
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
    let base = color(lattice.kind());
    for face in &lattice.cell().faces {
        let normal = lattice.center(face.neighbor).normalize();
        if normal.dot(&eye) <= 1e-9 {
            continue;
        }
        let shade = 0.2 + 0.75 * normal.dot(&light).max(0.0);
        // From a dark tone of the colour to a light one.
        let tone = |channel: u8| {
            let channel = f64::from(channel);
            (0.35 * channel + 45.0) * (1.0 - shade) + (0.35 * channel + 165.0) * shade
        };
        let corners = lattice.cell().polygon(face).map(|corner| {
            let (across, high) = (corner.dot(&right), corner.dot(&up));
            format!("{:.2},{:.2}", x + SCALE * across, y - SCALE * high)
        });
        writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"rgb({:.0},{:.0},{:.0})\" stroke=\"rgb({},{},{})\" \
             stroke-width=\"1.6\" stroke-linejoin=\"round\"/>",
            corners.collect::<Vec<_>>().join(" "),
            tone(base.0),
            tone(base.1),
            tone(base.2),
            base.0,
            base.1,
            base.2
        )?;
    }
    Ok(())
}
