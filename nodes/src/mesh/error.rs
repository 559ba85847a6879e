//! Reasons for rejecting meshes.

use thiserror::Error;

use crate::files::points::PointFileError;

/// Reason for rejecting a mesh.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum MeshError {
    /// Count above a limit.
    #[error("{found} {what}, more than {max}")]
    TooMany {
        what: &'static str,
        found: usize,
        max: usize,
    },
    /// Number of labels that does not match the triangles.
    #[error("{found} {what} for {triangles} triangles")]
    Count {
        what: &'static str,
        found: usize,
        triangles: usize,
    },
    /// Vertex that is not finite, or beyond millimetre precision.
    #[error(
        "vertex {vertex} is at {value} m, not within {max} m; check the unit or move the mesh to its origin"
    )]
    Beyond { vertex: usize, value: f32, max: f32 },
    /// Vertex index out of range.
    #[error("triangle {triangle} refers to vertex {vertex}, outside 0..{vertices}")]
    Index {
        triangle: usize,
        vertex: u32,
        vertices: usize,
    },
    /// Hierarchy of triangles that is too deep.
    #[error("the triangles are nested {depth} levels deep; remove hidden triangles")]
    Nested { depth: u32 },
    /// Malformed file.
    #[error(transparent)]
    File(#[from] PointFileError),
    /// Invalid line of an OBJ file.
    #[error("OBJ line {line}: {reason}")]
    Obj { line: u64, reason: String },
    /// Invalid glTF file.
    #[error("glTF: {0}")]
    Gltf(String),
    /// Triangle count of a file above the limit.
    #[error("the file has {triangles} triangles or more, more than {max}: simplify the mesh")]
    FileTooLarge { triangles: u64, max: usize },
    /// Valid file without a mesh.
    #[error("the file contains no mesh: {0}")]
    NoMesh(#[source] Box<MeshError>),
}

impl MeshError {
    /// Counter name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::TooMany { .. } | Self::FileTooLarge { .. } => "too_large",
            Self::Count { .. } => "malformed",
            Self::Beyond { value, .. } if value.is_finite() => "too_far",
            Self::Beyond { .. } => "not_finite",
            Self::Index { .. } => "indices",
            Self::Nested { .. } => "nested",
            Self::File(_) | Self::Obj { .. } | Self::Gltf(_) | Self::NoMesh(_) => "file",
        }
    }
}
