//! Distance between a line and a cell by trying every pair of corners, edges and triangles.

use lattice_core::lattice::{Lattice, LatticeIndex};
use nalgebra::Vector3;

use crate::raycast::crosses;

type Point = Vector3<f64>;

/// Distance of a line (or a point: a line of equal ends) to a cell, 0 if they touch or overlap.
pub fn distance(lattice: &Lattice, w: LatticeIndex, line: &[Point; 2]) -> f64 {
    let [from, to] = line;
    if crosses(lattice, w, [from, to], 0.0) {
        return 0.0;
    }
    let (cell, center) = (lattice.cell(), lattice.center(w));
    let triangles = cell.faces.iter().flat_map(|face| cell.triangles(face));
    let least = triangles.map(|triangle| {
        let [a, b, c] = triangle.map(|p| p + center);
        let inner = line.map(|p| to_triangle(&p, &[a, b, c]));
        let edges = [[a, b], [b, c], [c, a]].map(|edge| between_lines(&edge, line));
        inner.into_iter().chain(edges).fold(f64::MAX, f64::min)
    });
    least.fold(f64::MAX, f64::min)
}

/// To the inside of a triangle; its border is left to the edges.
fn to_triangle(p: &Point, [a, b, c]: &[Point; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a)).normalize();
    let foot = p - normal * normal.dot(&(p - a));
    let left = |s: &Point, t: &Point| (t - s).cross(&(foot - s)).dot(&normal) >= 0.0;
    if left(a, b) && left(b, c) && left(c, a) {
        (p - foot).norm()
    } else {
        f64::MAX
    }
}

fn to_line(p: &Point, [a, b]: &[Point; 2]) -> f64 {
    let along = b - a;
    let t = (p - a).dot(&along) / along.norm_squared();
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    (p - (a + along * t)).norm()
}

/// Either the feet of the common perpendicular are on both lines, or an end is nearest.
fn between_lines(e: &[Point; 2], f: &[Point; 2]) -> f64 {
    let ends = [(&e[0], f), (&e[1], f), (&f[0], e), (&f[1], e)];
    let ends = ends.map(|(p, line)| to_line(p, line));
    let least = ends.into_iter().fold(f64::MAX, f64::min);
    let (u, v, w) = (e[1] - e[0], f[1] - f[0], f[0] - e[0]);
    let n = u.cross(&v);
    let s = w.cross(&v).dot(&n) / n.norm_squared();
    let t = w.cross(&u).dot(&n) / n.norm_squared();
    let within = |x: f64| (0.0..=1.0).contains(&x);
    if within(s) && within(t) {
        least.min((w + v * t - u * s).norm())
    } else {
        least
    }
}
