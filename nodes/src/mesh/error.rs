//! Errors of meshes.

use thiserror::Error;

use crate::files::points::PointFileError;

/// Error of a mesh that cannot be used.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum MeshError {
    /// More of something than is taken.
    #[error("{found} {what}, but at most {max} are taken")]
    TooMany {
        what: &'static str,
        found: usize,
        max: usize,
    },
    /// Another number of labels than of triangles.
    #[error("{found} {what} for {triangles} triangles")]
    Count {
        what: &'static str,
        found: usize,
        triangles: usize,
    },
    /// A vertex that is not finite, or so far that millimetres are lost.
    #[error(
        "vertex {vertex} is at {value} m, not within {max} m; check the unit or move the mesh to its origin"
    )]
    Beyond { vertex: usize, value: f32, max: f32 },
    /// A triangle of a vertex that is not there.
    #[error("triangle {triangle} has vertex {vertex}, but there are {vertices}")]
    Index {
        triangle: usize,
        vertex: u32,
        vertices: usize,
    },
    /// A tree of triangles that is too deep.
    #[error("the triangles are nested {depth} levels deep; cut away what nobody sees")]
    Nested { depth: u32 },
    /// A file that is not what it should be.
    #[error(transparent)]
    File(#[from] PointFileError),
    /// A line of an OBJ file that cannot be read.
    #[error("OBJ line {line}: {reason}")]
    Obj { line: u64, reason: String },
    /// A glTF file that cannot be read.
    #[error("glTF: {0}")]
    Gltf(String),
    /// A file with more triangles than are taken.
    #[error(
        "the file has {triangles} triangles or more, but at most {max} are allowed: simplify the mesh"
    )]
    FileTooLarge { triangles: u64, max: usize },
    /// A file that could be read.
    #[error("the file was read, but is no mesh: {0}")]
    NoMesh(#[source] Box<MeshError>),
}

impl MeshError {
    /// Name under which it is counted.
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
