//! Figures of merit of a cell, exact from its polyhedron.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::Vector3;

use super::{Lattice, VoronoiCell};

impl Lattice {
    /// Mean squared distance of a uniform point from its lattice point, by dimension and over the
    /// squared cell side: the constant G of quantization theory, 1/12 for cubes.
    pub fn second_moment(&self) -> f64 {
        let moment = |[a, b, c]: [Vector3<f64>; 3]| {
            let volume = a.dot(&b.cross(&c)) / 6.0;
            let squares = a.norm_squared() + b.norm_squared() + c.norm_squared();
            volume / 10.0 * (squares + a.dot(&b) + b.dot(&c) + c.dot(&a))
        };
        let sum: f64 = triangles(self.cell()).map(moment).sum();
        sum / (3.0 * self.cell_volume_m3() * self.cell_side_m() * self.cell_side_m())
    }

    /// Width of the cell averaged over all directions, metres. Over the cell volume: the cells per
    /// area that a plane of random orientation cuts.
    pub fn mean_width_m(&self) -> f64 {
        // Edges by their lengths and the angles between the normals of their faces.
        let mut normals: BTreeMap<(u16, u16), Vec<Vector3<f64>>> = BTreeMap::new();
        for face in &self.cell().faces {
            let next = face.vertices.iter().cycle().skip(1);
            for (&from, &to) in face.vertices.iter().zip(next) {
                let edge = (from.min(to), from.max(to));
                normals
                    .entry(edge)
                    .or_default()
                    .push(self.center(face.neighbor));
            }
        }
        let vertex = |i: u16| self.cell().vertices.get(usize::from(i)).copied();
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
    pub fn surface_m2(&self) -> f64 {
        let area = |[a, b, c]: [Vector3<f64>; 3]| 0.5 * (b - a).cross(&(c - a)).norm();
        triangles(self.cell()).map(area).sum()
    }
}

fn triangles(cell: &VoronoiCell) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
    cell.faces.iter().flat_map(|face| cell.triangles(face))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, UnitQuaternion};

    use super::*;
    use crate::lattice::LatticeKind;

    #[test]
    fn constants_are_those_of_the_theory() {
        for (kind, moment, width, surface) in [
            (LatticeKind::Cubic, 0.0833333, 1.500000, 6.00000),
            (LatticeKind::Bcc, 0.0785433, 1.336348, 5.31474),
            (LatticeKind::Fcc, 0.0787451, 1.374730, 5.34539),
            (LatticeKind::Mcc, 0.0786696, 1.344977, 5.32826),
            (LatticeKind::Hex, 0.0834602, 1.436166, 5.79864),
            (LatticeKind::HexOptimal, 0.0812227, 1.430220, 5.72444),
        ] {
            // Whatever the size and the orientation.
            let turn = UnitQuaternion::from_euler_angles(0.3, 0.2, 0.1);
            let lattice = Lattice::new(kind, 8.0).unwrap().oriented(turn);
            assert!((lattice.second_moment() - moment).abs() < 5.1e-8, "{kind}");
            assert!(
                (lattice.mean_width_m() / 2.0 - width).abs() < 5.1e-7,
                "{kind}"
            );
            assert!(
                (lattice.surface_m2() / 4.0 - surface).abs() < 5.1e-6,
                "{kind}"
            );
        }
    }

    #[test]
    fn a_box_has_the_figures_of_a_box() {
        let sides = Vector3::new(0.5, 1.0, 1.5);
        let lattice = Lattice::from_basis(Matrix3::from_diagonal(&sides)).unwrap();
        let side = lattice.cell_side_m();
        let moment = sides.norm_squared() / 36.0 / (side * side);
        assert!((lattice.second_moment() - moment).abs() < 1e-12);
        assert!((lattice.mean_width_m() - sides.sum() / 2.0).abs() < 1e-12);
        assert!((lattice.surface_m2() - 5.5).abs() < 1e-12);
    }
}
