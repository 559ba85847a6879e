//! Export of the surface of occupied cells.

use std::io::{BufWriter, Write};

use lattice_core::lattice::LatticeIndex;
use lattice_core::voxels::VoxelList;
use nalgebra::Vector3;
use rustc_hash::FxHashMap;

use super::error::ExportError;
use super::palette::{HeightRange, color_at};
use super::ply_header::{comment, ply_header};
use super::vertices::SharedVertices;

/// Writes the faces between occupied and empty cells as a binary PLY mesh of convex polygons.
///
/// Shared corners are one vertex: `x`, `y`, `z` (double, metres, map frame), coloured by
/// height. Polygons are counter-clockwise seen from the empty side. Equal maps give equal bytes.
pub fn write_mesh_ply(list: &VoxelList, writer: impl Write) -> Result<(), ExportError> {
    let mesh = Mesh::of(list)?;
    let heights = HeightRange::of(mesh.vertices_m.iter().map(|v| v.z));
    let mut writer = BufWriter::new(writer);
    let [x, y, z] = ["double x", "double y", "double z"];
    let properties = [x, y, z, "uchar red", "uchar green", "uchar blue"];
    let vertices = ("vertex", mesh.vertices_m.len() as u64, &properties[..]);
    let indices = &["list uchar int vertex_indices"][..];
    let faces = ("face", mesh.faces as u64, indices);
    writer.write_all(ply_header(&comment(list), &[vertices, faces]).as_bytes())?;
    for vertex in &mesh.vertices_m {
        for coordinate in vertex.iter() {
            writer.write_all(&coordinate.to_le_bytes())?;
        }
        writer.write_all(&color_at(heights.fraction(vertex.z)))?;
    }
    writer.write_all(&mesh.polygons)?;
    writer.flush()?;
    Ok(())
}

struct Mesh {
    vertices_m: Vec<Vector3<f64>>,
    faces: usize,
    /// Polygons with their lengths, in PLY form.
    polygons: Vec<u8>,
}

impl Mesh {
    fn of(list: &VoxelList) -> Result<Mesh, ExportError> {
        let cell = list.lattice().cell();
        let shared = SharedVertices::new(list.lattice());
        let exposed = list.exposed_faces();
        let mut numbers: FxHashMap<(LatticeIndex, u16), i32> = FxHashMap::default();
        let mut mesh = Mesh {
            vertices_m: Vec::new(),
            faces: exposed.len(),
            polygons: Vec::new(),
        };
        for (key, face) in exposed {
            let corners = cell.faces.get(face).map_or(&[][..], |face| &face.vertices);
            // A face has at most six corners.
            mesh.polygons.push(corners.len() as u8);
            for name in corners.iter().filter_map(|&c| shared.name(key.unpack(), c)) {
                let next =
                    i32::try_from(numbers.len()).map_err(|_| ExportError::TooManyVertices)?;
                let number = *numbers.entry(name).or_insert_with(|| {
                    let (w, corner) = name;
                    let corner = cell.vertices.get(usize::from(corner));
                    let offset = corner.copied().unwrap_or_default();
                    mesh.vertices_m
                        .push(list.datum_m() + list.lattice().center(w) + offset);
                    next
                });
                mesh.polygons.extend(number.to_le_bytes());
            }
        }
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};

    use super::*;

    fn list(kind: LatticeKind, cells: &[LatticeIndex]) -> VoxelList {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        let centers: Vec<_> = cells.iter().map(|&w| lattice.center(w)).collect();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &centers));
        list
    }

    fn polygons(mesh: &Mesh) -> Vec<Vec<i32>> {
        let mut rest = mesh.polygons.as_slice();
        let mut polygons = Vec::new();
        while let Some((&length, after)) = rest.split_first() {
            let (polygon, after) = after.split_at(4 * usize::from(length));
            let indices = polygon
                .chunks(4)
                .map(|b| i32::from_le_bytes(b.try_into().unwrap()));
            polygons.push(indices.collect());
            rest = after;
        }
        polygons
    }

    /// Vertices - edges + faces, and the volume inside.
    fn euler_and_volume(mesh: &Mesh) -> (i64, f64) {
        let mut edges = BTreeSet::new();
        let mut volume_m3 = 0.0;
        for polygon in polygons(mesh) {
            let corner = |i: usize| mesh.vertices_m[polygon[i] as usize];
            for i in 1..polygon.len() - 1 {
                volume_m3 += corner(0).dot(&corner(i).cross(&corner(i + 1))) / 6.0;
            }
            for (i, &from) in polygon.iter().enumerate() {
                edges.insert((from, polygon[(i + 1) % polygon.len()]));
            }
        }
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
        let euler = mesh.vertices_m.len() + mesh.faces;
        (euler as i64 - edges.len() as i64 / 2, volume_m3)
    }

    #[test]
    fn a_cell_and_a_pair_of_cells_are_closed_solids_of_their_volume() {
        for kind in LatticeKind::ALL {
            let neighbor = Lattice::new(kind, 1.0).unwrap().face_neighbors()[0];
            for cells in [&[[0, 0, 0]][..], &[[0, 0, 0], neighbor]] {
                let mesh = Mesh::of(&list(kind, cells)).unwrap();
                let (euler, volume_m3) = euler_and_volume(&mesh);
                assert_eq!(euler, 2, "{kind}");
                assert!((volume_m3 - cells.len() as f64).abs() < 1e-9, "{kind}");
            }
        }
    }

    #[test]
    fn the_file_has_what_its_header_says() {
        let list = list(LatticeKind::Fcc, &[[0, 0, 0], [5, 5, 5]]);
        let mut bytes = Vec::new();
        write_mesh_ply(&list, &mut bytes).unwrap();
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..start]).unwrap();
        assert!(header.contains("element vertex 28\n"), "{header}");
        assert!(header.contains("element face 24\n"), "{header}");
        assert_eq!(bytes.len() - start, 28 * (24 + 3) + 24 * (1 + 4 * 4));
    }
}
