//! Voronoi cell of a lattice.

use nalgebra::{Matrix3, Vector3};

use super::LatticeIndex;

/// Tolerance of a vertex beyond a face, relative to the squared length of the neighbour.
const SLACK: f64 = 1e-9;

/// Voronoi cell of lattice point 0, metres, in the axes of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct VoronoiCell {
    /// Vertices, each once.
    pub vertices: Vec<Vector3<f64>>,
    /// Faces, in the order of `Lattice::face_neighbors`.
    pub faces: Vec<CellFace>,
}

/// Convex polygon halfway to a neighbouring cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellFace {
    /// Index difference to the cell on the other side.
    pub neighbor: LatticeIndex,
    /// Indices of `VoronoiCell::vertices`, counter-clockwise seen from outside.
    pub vertices: Vec<u16>,
}

impl VoronoiCell {
    /// Intersects the half spaces `n . x <= |n|^2 / 2` of the Voronoi-relevant vectors `n`.
    pub(super) fn new(generator: &Matrix3<f64>, relevant: &[LatticeIndex]) -> VoronoiCell {
        let normals: Vec<Vector3<f64>> = relevant
            .iter()
            .map(|w| generator * Vector3::from(w.map(f64::from)))
            .collect();
        let vertices = corners(&normals);
        let faces = relevant.iter().zip(&normals);
        let faces = faces
            .map(|(&neighbor, normal)| CellFace {
                neighbor,
                vertices: polygon(normal, &vertices),
            })
            .collect();
        VoronoiCell { vertices, faces }
    }

    /// Volume in m^3.
    pub fn volume_m3(&self) -> f64 {
        let cone = |t: [Vector3<f64>; 3]| t[0].dot(&t[1].cross(&t[2])) / 6.0;
        self.faces
            .iter()
            .flat_map(|face| self.triangles(face))
            .map(cone)
            .sum()
    }

    /// Vertices of a face in order.
    pub fn polygon(&self, face: &CellFace) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let vertices = face.vertices.clone();
        vertices
            .into_iter()
            .filter_map(|i| self.vertices.get(usize::from(i)).copied())
    }

    /// Triangle fan of a face, counter-clockwise seen from outside.
    pub fn triangles(&self, face: &CellFace) -> Vec<[Vector3<f64>; 3]> {
        let corners: Vec<_> = self.polygon(face).collect();
        let Some((&first, rest)) = corners.split_first() else {
            return Vec::new();
        };
        rest.iter()
            .zip(rest.iter().skip(1))
            .map(|(&b, &c)| [first, b, c])
            .collect()
    }
}

fn on_plane(normal: &Vector3<f64>, p: &Vector3<f64>) -> bool {
    (normal.dot(p) - 0.5 * normal.norm_squared()).abs() <= SLACK * normal.norm_squared()
}

/// Corners of the polyhedron `n . x <= |n|^2 / 2` for all normals `n`, each once.
pub(crate) fn corners(normals: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut found: Vec<Vector3<f64>> = Vec::new();
    for (i, a) in normals.iter().enumerate() {
        for (j, b) in normals.iter().enumerate().skip(i + 1) {
            for c in normals.iter().skip(j + 1) {
                let rows = Matrix3::from_rows(&[a.transpose(), b.transpose(), c.transpose()]);
                let lengths = Vector3::new(a.norm_squared(), b.norm_squared(), c.norm_squared());
                let flat = rows.determinant().abs() <= SLACK * a.norm() * b.norm() * c.norm();
                let Some(inverse) = rows.try_inverse().filter(|_| !flat) else {
                    continue;
                };
                let p = inverse * lengths * 0.5;
                let inside = |n: &Vector3<f64>| n.dot(&p) <= (0.5 + SLACK) * n.norm_squared();
                let known =
                    |q: &Vector3<f64>| (q - p).norm_squared() <= SLACK * SLACK * a.norm_squared();
                if normals.iter().all(inside) && !found.iter().any(known) {
                    found.push(p);
                }
            }
        }
    }
    found
}

/// Vertices on the plane of `normal`, ordered around it.
fn polygon(normal: &Vector3<f64>, vertices: &[Vector3<f64>]) -> Vec<u16> {
    let on: Vec<(u16, Vector3<f64>)> = (0..)
        .zip(vertices.iter().copied())
        .filter(|(_, p)| on_plane(normal, p))
        .collect();
    let Some(&(_, first)) = on.first() else {
        return Vec::new();
    };
    // The face is centred on half of the normal.
    let x = first - 0.5 * normal;
    let y = normal.cross(&x);
    let angle = |p: &Vector3<f64>| {
        let angle = (p.dot(&y) * x.norm()).atan2(p.dot(&x) * y.norm());
        if angle < 0.0 {
            angle + std::f64::consts::TAU
        } else {
            angle
        }
    };
    let mut around: Vec<(f64, u16)> = on
        .iter()
        .map(|(i, p)| {
            (
                if *p == first {
                    0.0
                } else {
                    angle(&(p - 0.5 * normal))
                },
                *i,
            )
        })
        .collect();
    around.sort_by(|a, b| a.0.total_cmp(&b.0));
    around.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::lattice::{Lattice, LatticeKind};

    fn cells() -> impl Iterator<Item = (Lattice, VoronoiCell)> {
        LatticeKind::ALL.into_iter().flat_map(|kind| {
            [1.0, 0.125, 1e-9, 1e9].map(|volume| {
                let lattice = Lattice::new(kind, volume).unwrap();
                let cell = lattice.cell().clone();
                (lattice, cell)
            })
        })
    }

    #[test]
    fn volume_is_the_cell_volume() {
        for (lattice, cell) in cells() {
            let relative = cell.volume_m3() / lattice.cell_volume_m3() - 1.0;
            assert!(relative.abs() < 1e-12, "{}: {relative}", lattice.kind());
        }
    }

    #[test]
    fn corners_and_faces_are_those_of_the_known_solids() {
        for (lattice, cell) in cells() {
            let mut sizes: BTreeMap<usize, usize> = BTreeMap::new();
            for face in &cell.faces {
                *sizes.entry(face.vertices.len()).or_default() += 1;
            }
            let sizes: Vec<_> = sizes.into_iter().collect();
            let (vertices, expected) = match lattice.kind() {
                LatticeKind::Cubic => (8, vec![(4, 6)]),
                LatticeKind::Bcc | LatticeKind::Mcc => (24, vec![(4, 6), (6, 8)]),
                LatticeKind::Fcc => (14, vec![(4, 12)]),
                LatticeKind::Hex | LatticeKind::HexOptimal => (12, vec![(4, 6), (6, 2)]),
                LatticeKind::Custom => panic!("has no known solid"),
            };
            assert_eq!(
                (cell.vertices.len(), sizes),
                (vertices, expected),
                "{}",
                lattice.kind()
            );
        }
    }

    #[test]
    fn edges_are_shared_by_two_faces_in_opposite_directions() {
        for (lattice, cell) in cells() {
            let mut edges: BTreeMap<(u16, u16), usize> = BTreeMap::new();
            for face in &cell.faces {
                for (i, &from) in face.vertices.iter().enumerate() {
                    let to = face.vertices[(i + 1) % face.vertices.len()];
                    *edges.entry((from, to)).or_default() += 1;
                }
            }
            assert!(edges.values().all(|&n| n == 1), "{}", lattice.kind());
            let twice = edges.keys().all(|&(a, b)| edges.contains_key(&(b, a)));
            assert!(twice, "{}", lattice.kind());
            let euler = cell.vertices.len() + cell.faces.len() - edges.len() / 2;
            assert_eq!(euler, 2, "{}", lattice.kind());
        }
    }

    #[test]
    fn faces_lie_halfway_to_their_neighbours_and_turn_counter_clockwise() {
        for (lattice, cell) in cells() {
            for (face, &neighbor) in cell.faces.iter().zip(lattice.face_neighbors()) {
                assert_eq!(face.neighbor, neighbor);
                let normal = lattice.center(neighbor);
                for p in cell.polygon(face) {
                    let beyond = normal.dot(&p) / normal.norm_squared() - 0.5;
                    assert!(beyond.abs() < 1e-12, "{}: {beyond}", lattice.kind());
                }
                for [a, b, c] in cell.triangles(face) {
                    assert!((b - a).cross(&(c - a)).dot(&normal) > 0.0);
                }
            }
        }
    }

    #[test]
    fn radii_are_those_of_the_theory() {
        for (kind, covering, packing) in [
            (LatticeKind::Cubic, 0.8660254, 0.5),
            (LatticeKind::Bcc, 0.7043173, 0.5455618),
            (LatticeKind::Fcc, 0.7937005, 0.5612310),
            (LatticeKind::Mcc, 0.7282377, 0.5493421),
            (LatticeKind::Hex, 0.7972334, 0.4163416),
            (LatticeKind::HexOptimal, 0.7959505, 0.4936275),
        ] {
            let lattice = Lattice::new(kind, 8.0).unwrap();
            let off = lattice.covering_radius_m() - 2.0 * covering;
            assert!(off.abs() < 1.1e-7, "{kind}");
            let off = lattice.packing_radius_m() - 2.0 * packing;
            assert!(off.abs() < 1.1e-7, "{kind}");
        }
    }
}
