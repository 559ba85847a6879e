//! Figures of merit of a cell, exact from its polyhedron.

use lattice_core::lattice::{Lattice, LatticeIndex, VoronoiCell};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Parts of a side of a triangle over which distances are integrated.
const PARTS: usize = 16;
/// Weight of the midst in Radon's rule of 1948, exact for polynomials up to degree 5 over a triangle.
const MIDST: f64 = 9.0 / 40.0;

/// Mean squared distance of a uniform point from its lattice point, by dimension and over the
/// squared cell side: the constant G of quantization theory, 1/12 for cubes.
pub fn second_moment(lattice: &Lattice) -> f64 {
    let moment = |[a, b, c]: [Vector3<f64>; 3]| {
        let volume = a.dot(&b.cross(&c)) / 6.0;
        let squares = a.norm_squared() + b.norm_squared() + c.norm_squared();
        volume / 10.0 * (squares + a.dot(&b) + b.dot(&c) + c.dot(&a))
    };
    let sum: f64 = triangles(lattice.cell()).map(moment).sum();
    sum / (3.0 * lattice.cell_volume_m3() * lattice.cell_side_m() * lattice.cell_side_m())
}

/// Width of the cell averaged over all directions, metres. Over the cell volume: the cells per
/// area that a plane of random orientation cuts.
pub fn mean_width_m(lattice: &Lattice) -> f64 {
    // Edges by their lengths and the angles between the normals of their faces.
    let mut normals: BTreeMap<(u16, u16), Vec<Vector3<f64>>> = BTreeMap::new();
    for face in &lattice.cell().faces {
        let next = face.vertices.iter().cycle().skip(1);
        for (&from, &to) in face.vertices.iter().zip(next) {
            let edge = (from.min(to), from.max(to));
            normals
                .entry(edge)
                .or_default()
                .push(lattice.center(face.neighbor));
        }
    }
    let vertex = |i: u16| lattice.cell().vertices.get(usize::from(i)).copied();
    let term = |(&(from, to), normals): (&(u16, u16), &Vec<Vector3<f64>>)| {
        let ([a, b], Some(p), Some(q)) = (normals.as_slice(), vertex(from), vertex(to)) else {
            return 0.0;
        };
        (p - q).norm() * a.cross(b).norm().atan2(a.dot(b))
    };
    normals.iter().map(term).sum::<f64>() / (4.0 * PI)
}

/// Surface of the cell, m^2. A quarter of it over the cell volume: the cells that a line of
/// random direction enters per metre.
pub fn surface_m2(lattice: &Lattice) -> f64 {
    let area = |[a, b, c]: [Vector3<f64>; 3]| 0.5 * (b - a).cross(&(c - a)).norm();
    triangles(lattice.cell()).map(area).sum()
}

/// Mean distance of a uniform point of the cell `w` from the lattice point 0, metres; of the cell 0
/// the expected distortion of eq. (13). Exact to some ten digits.
pub fn mean_distance_m(lattice: &Lattice, w: LatticeIndex) -> f64 {
    let center = lattice.center(w);
    // The divergence of |x| x is 4 |x|: an integral over the surface.
    let term = |corners: [Vector3<f64>; 3]| {
        let [a, b, c] = corners.map(|corner| corner + center);
        let flux = 0.5 * a.dot(&(b - a).cross(&(c - a)));
        flux * mean_norm(a, b, c) / 4.0
    };
    triangles(lattice.cell()).map(term).sum::<f64>() / lattice.cell_volume_m3()
}

/// Mean of the norm over a triangle.
fn mean_norm(a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>) -> f64 {
    let root = 15.0_f64.sqrt();
    let triples = [-1.0, 1.0].map(|sign| {
        let equal = (6.0 + sign * root) / 21.0;
        (equal, (155.0 + sign * root) / 1200.0)
    });
    let (u, v) = ((b - a) / PARTS as f64, (c - a) / PARTS as f64);
    let over = |corner: Vector3<f64>, u: Vector3<f64>, v: Vector3<f64>| {
        let at = |s: f64, t: f64| (corner + u * s + v * t).norm();
        let triple = |(e, weight): (f64, f64)| {
            let other = 1.0 - 2.0 * e;
            weight * (at(e, e) + at(e, other) + at(other, e))
        };
        MIDST * at(1.0 / 3.0, 1.0 / 3.0) + triples.map(triple).iter().sum::<f64>()
    };
    let mut sum = 0.0;
    for i in 0..PARTS {
        for j in 0..PARTS - i {
            let corner = a + u * i as f64 + v * j as f64;
            sum += over(corner, u, v);
            if i + j + 1 < PARTS {
                sum += over(corner + u + v, -u, -v);
            }
        }
    }
    sum / (PARTS * PARTS) as f64
}

fn triangles(cell: &VoronoiCell) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
    cell.faces.iter().flat_map(|face| cell.triangles(face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;
    use nalgebra::Matrix3;

    #[test]
    fn a_box_has_the_figures_of_a_box() {
        let sides = Vector3::new(0.5, 1.0, 1.5);
        let lattice = Lattice::from_basis(Matrix3::from_diagonal(&sides)).unwrap();
        let side = lattice.cell_side_m();
        let moment = sides.norm_squared() / 36.0 / (side * side);
        assert!((second_moment(&lattice) - moment).abs() < 1e-12);
        assert!((mean_width_m(&lattice) - sides.sum() / 2.0).abs() < 1e-12);
        assert!((surface_m2(&lattice) - 5.5).abs() < 1e-12);
    }

    #[test]
    fn mean_distances_of_other_cells_are_those_of_the_theory() {
        // Robbins' constant: a cube about its corner.
        let cube = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        let corner = 0.9605919564;
        let eighths = Lattice::new(LatticeKind::Cubic, 8.0).unwrap();
        assert!((mean_distance_m(&eighths, [0; 3]) - corner).abs() < 1e-9);
        // Far away it is the distance of the centre and the spread across it.
        let far = mean_distance_m(&cube, [1000, 0, 0]);
        assert!((far - 1000.0 - 1.0 / 12_000.0).abs() < 1e-7, "{far}");
    }
}
