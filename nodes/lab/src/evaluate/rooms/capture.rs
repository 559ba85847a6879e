//! Rooms captured with a headset, as the emulator of npm `@iwer/sem` keeps them.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use lattice_core::pose::Axes;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::path::Path;

use crate::mesh::{LabelledMesh, MAX_TRIANGLES};
use crate::{AnyError, at};

/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 28;

/// Room with its spatial entities: y up, z backward.
#[derive(Deserialize)]
struct Capture {
    #[serde(rename = "spatialEntities")]
    entities: Vec<Entity>,
}

#[derive(Deserialize)]
struct Entity {
    #[serde(rename = "locatable_META")]
    pose: Option<Pose>,
    #[serde(rename = "triangleMesh_META")]
    mesh: Option<Mesh>,
}

#[derive(Deserialize)]
struct Pose {
    orientation: Orientation,
    position: Position,
}

#[derive(Deserialize)]
struct Orientation {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Deserialize)]
struct Position {
    x: f64,
    y: f64,
    z: f64,
}

/// Base64 of little-endian `f32` coordinates and `u32` indices.
#[derive(Deserialize)]
struct Mesh {
    vertices: String,
    indices: String,
}

/// Mesh of a captured room, metres, z up, and the checksum of its file.
pub fn read_capture(path: &Path) -> Result<(LabelledMesh, u32), AnyError> {
    let bytes = std::fs::metadata(path).map_err(at(path))?.len();
    if bytes > MAX_BYTES {
        return Err(at(path)(format!("{bytes} bytes, more than {MAX_BYTES}")));
    }
    let text = std::fs::read(path).map_err(at(path))?;
    let mesh = parse(&text).map_err(at(path))?;
    Ok((mesh, crc32fast::hash(&text)))
}

fn parse(text: &[u8]) -> Result<LabelledMesh, AnyError> {
    let capture: Capture = serde_json::from_slice(text)?;
    let (mut vertices_m, mut triangles) = (Vec::new(), Vec::new());
    for (mesh, pose) in capture.entities.iter().filter_map(Entity::mesh) {
        let first = u32::try_from(vertices_m.len())?;
        for [x, y, z] in triples(&mesh.vertices, f32::from_le_bytes)? {
            let place = pose * Point3::new(x, y, z).cast::<f64>();
            let place = Axes::WinrtRub.point_to_ros(&place).cast::<f32>();
            vertices_m.push(place.into());
        }
        for corners in triples(&mesh.indices, u32::from_le_bytes)? {
            triangles.push(corners.map(|corner| first.saturating_add(corner)));
        }
    }
    if triangles.is_empty() {
        return Err("no entity has a triangle mesh".into());
    }
    let none = vec![0; triangles.len()];
    Ok(LabelledMesh::new(
        vertices_m,
        triangles,
        none.clone(),
        none,
    )?)
}

impl Entity {
    /// Mesh and its pose, if there is a mesh.
    fn mesh(&self) -> Option<(&Mesh, Isometry3<f64>)> {
        let Pose {
            orientation: o,
            position: p,
        } = self.pose.as_ref()?;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(o.w, o.x, o.y, o.z));
        let pose = Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), turn);
        Some((self.mesh.as_ref()?, pose))
    }
}

/// Triples of four-byte numbers in base64.
fn triples<T>(text: &str, number: fn([u8; 4]) -> T) -> Result<Vec<[T; 3]>, AnyError> {
    let bytes = STANDARD.decode(text)?;
    let (numbers, rest) = bytes.as_chunks::<4>();
    let (triples, left) = numbers.as_chunks::<3>();
    if !rest.is_empty() || !left.is_empty() || triples.len() > MAX_TRIANGLES {
        let bytes = bytes.len();
        return Err(format!("{bytes} bytes of a mesh are not triples of numbers").into());
    }
    Ok(triples.iter().map(|three| three.map(number)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn capture(indices: &[u32]) -> String {
        let vertices = [1.0_f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let vertices: Vec<u8> = vertices.iter().flat_map(|v| v.to_le_bytes()).collect();
        let indices: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let (vertices, indices) = (STANDARD.encode(vertices), STANDARD.encode(indices));
        format!(
            r#"{{"spatialEntities": [{{"semanticLabel_META": "FLOOR"}}, {{"locatable_META": {{
            "orientation": {{"x": 0, "y": 0, "z": 0, "w": 1}}, "position": {{"x": 0, "y": 2, "z": 0}}}},
            "triangleMesh_META": {{"vertices": "{vertices}", "indices": "{indices}"}}}}]}}"#
        )
    }

    #[test]
    fn a_mesh_is_placed_and_has_z_up() {
        let mesh = parse(capture(&[0, 1, 2]).as_bytes()).unwrap();
        let expected = [[0.0, -1.0, 2.0], [0.0, 0.0, 3.0], [-1.0, 0.0, 2.0]];
        assert_eq!(mesh.vertices_m(), expected);
        assert_eq!(mesh.triangles(), [[0, 1, 2]]);
    }

    #[test]
    fn a_mesh_that_is_none_is_refused() {
        for indices in [&[0, 1, 3][..], &[0, 1], &[]] {
            assert!(parse(capture(indices).as_bytes()).is_err(), "{indices:?}");
        }
        assert!(parse(b"{}").is_err());
    }
}
