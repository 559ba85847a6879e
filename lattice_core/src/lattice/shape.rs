//! Geometry of the cells of a lattice.

use nalgebra::{Matrix3, UnitQuaternion};

use super::orientation::matrix;
use super::{LatticeIndex, LatticeKind, VoronoiCell, center};

/// Parts of a lattice shared by its clones.
#[derive(Clone)]
pub(super) struct Shape {
    pub(super) kind: LatticeKind,
    pub(super) cell_volume_m3: f64,
    /// Generator in the lattice's own axes.
    pub(super) generator: Matrix3<f64>,
    pub(super) map_from_lattice: UnitQuaternion<f64>,
    /// Voronoi cell in the axes of the map.
    pub(super) cell: VoronoiCell,
    pub(super) covering_radius_m: f64,
    pub(super) packing_radius_m: f64,
    /// Touching cells, face neighbours first.
    pub(super) touching: Vec<LatticeIndex>,
    faces: usize,
}

impl Shape {
    /// Creates an unoriented shape; `touching` starts with `faces`.
    pub(super) fn new(
        kind: LatticeKind,
        cell_volume_m3: f64,
        generator: Matrix3<f64>,
        faces: &[LatticeIndex],
        touching: &[LatticeIndex],
    ) -> Shape {
        let cell = VoronoiCell::new(&generator, faces);
        let covering_radius_m = cell.vertices.iter().map(|v| v.norm()).fold(0.0, f64::max);
        let nearest = |w: &LatticeIndex| 0.5 * center(&generator, *w).norm();
        let packing_radius_m = faces.iter().map(nearest).fold(f64::MAX, f64::min);
        Shape {
            kind,
            cell_volume_m3,
            generator,
            map_from_lattice: UnitQuaternion::identity(),
            cell,
            covering_radius_m,
            packing_radius_m,
            touching: touching.to_vec(),
            faces: faces.len(),
        }
    }

    /// Rotates the shape; vertices and faces keep their indices.
    pub(super) fn oriented(&self, map_from_lattice: UnitQuaternion<f64>) -> Shape {
        let mut cell = VoronoiCell::new(&self.generator, self.face_neighbors());
        if map_from_lattice != UnitQuaternion::identity() {
            let rotation = matrix(&map_from_lattice);
            for vertex in &mut cell.vertices {
                *vertex = rotation * *vertex;
            }
        }
        Shape {
            map_from_lattice,
            cell,
            ..self.clone()
        }
    }

    pub(super) fn face_neighbors(&self) -> &[LatticeIndex] {
        self.touching.get(..self.faces).unwrap_or_default()
    }
}
