//! Triangle mesh with a class and an instance per triangle.

use super::MeshError;

/// Limit of triangles and of vertices of a mesh.
pub const MAX_TRIANGLES: usize = 20_000_000;
/// Largest coordinate with millimetre precision in f32.
pub const MAX_COORDINATE_M: f32 = 1.0e4;

/// Triangles with a class and an instance each, in a frame defined by the owner.
///
/// An instance is one object: a chair, a shelf, or all walls.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct LabelledMesh {
    vertices_m: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    labels: Vec<u16>,
    instances: Vec<u16>,
}

/// Vertices, triangles, labels and instances while reading.
#[derive(Default)]
pub(super) struct Parts {
    pub vertices_m: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub labels: Vec<u16>,
    pub instances: Vec<u16>,
}

impl Parts {
    /// Validated mesh of the parts.
    pub fn mesh(self) -> Result<LabelledMesh, MeshError> {
        LabelledMesh::new(self.vertices_m, self.triangles, self.labels, self.instances)
    }
}

impl LabelledMesh {
    /// Mesh from vertices (metres), triangles (three vertex indices each) and the class and instance of
    /// each triangle.
    pub fn new(
        vertices_m: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        labels: Vec<u16>,
        instances: Vec<u16>,
    ) -> Result<LabelledMesh, MeshError> {
        for (what, found) in [
            ("vertices", vertices_m.len()),
            ("triangles", triangles.len()),
        ] {
            if found > MAX_TRIANGLES {
                let max = MAX_TRIANGLES;
                return Err(MeshError::TooMany { what, found, max });
            }
        }
        for (what, found) in [("labels", labels.len()), ("instances", instances.len())] {
            if found != triangles.len() {
                let triangles = triangles.len();
                return Err(MeshError::Count {
                    what,
                    found,
                    triangles,
                });
            }
        }
        for (vertex, point) in vertices_m.iter().enumerate() {
            let beyond = |c: &&f32| !(-MAX_COORDINATE_M..=MAX_COORDINATE_M).contains(*c);
            if let Some(&value) = point.iter().find(beyond) {
                let max = MAX_COORDINATE_M;
                return Err(MeshError::Beyond { vertex, value, max });
            }
        }
        let vertices = vertices_m.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(MeshError::Index {
                    triangle,
                    vertex,
                    vertices,
                });
            }
        }
        Ok(LabelledMesh {
            vertices_m,
            triangles,
            labels,
            instances,
        })
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// True without triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The vertices, metres.
    pub fn vertices_m(&self) -> &[[f32; 3]] {
        &self.vertices_m
    }

    /// Vertex indices of each triangle, all valid.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The class of each triangle.
    pub fn labels(&self) -> &[u16] {
        &self.labels
    }

    /// The instance of each triangle.
    pub fn instances(&self) -> &[u16] {
        &self.instances
    }

    /// The corners of each triangle, metres.
    pub fn corners_m(&self) -> impl ExactSizeIterator<Item = [[f32; 3]; 3]> + '_ {
        self.triangles
            .iter()
            .map(|corners| corners.map(|v| self.vertices_m[v as usize]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_mesh_is_refused_with_the_place_of_the_fault() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = |corners: &[[f32; 3]], triangles: &[[u32; 3]], labels: usize| {
            let (triangles, labels) = (triangles.to_vec(), vec![1; labels]);
            LabelledMesh::new(corners.to_vec(), triangles, labels.clone(), labels)
        };
        assert_eq!(mesh(&corners, &[[0, 1, 2]], 1).unwrap().len(), 1);
        assert!(mesh(&[], &[], 0).unwrap().is_empty());
        let error = mesh(&corners, &[[0, 1, 2]], 2).unwrap_err();
        assert_eq!(error.to_string(), "2 labels for 1 triangles");
        let error = mesh(&corners, &[[0, 1, 2], [2, 3, 0]], 2).unwrap_err();
        assert_eq!(
            error.to_string(),
            "triangle 1 refers to vertex 3, outside 0..3"
        );
        for value in [f32::NAN, f32::NEG_INFINITY, 2.0e4] {
            let corners = [[0.0; 3], [0.0, value, 0.0]];
            let error = mesh(&corners, &[], 0).unwrap_err();
            assert!(error.to_string().starts_with("vertex 1 is at"), "{error}");
        }
    }
}
