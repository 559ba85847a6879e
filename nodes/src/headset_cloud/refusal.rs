//! Errors of meshes that cannot be used.

use thiserror::Error;

use crate::mesh::MeshError;

/// Error of a surface of a mesh that cannot be used.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum MeshRefusal {
    /// A frame that is not the headset's.
    #[error("surface in frame '{found}', expected '{expected}'")]
    Frame { found: String, expected: String },
    /// A message whose parts do not fit each other.
    #[error("surface '{surface}': {problem}")]
    Malformed {
        surface: String,
        problem: &'static str,
    },
    /// Triangles that are none.
    #[error("surface '{surface}': {error}")]
    Mesh { surface: String, error: MeshError },
    /// More than `max_triangles` in all surfaces.
    #[error(
        "surface '{surface}': {triangles} triangles with the other surfaces, more than `max_triangles` {max}"
    )]
    TooManyTriangles {
        surface: String,
        triangles: usize,
        max: usize,
    },
    /// More than `max_surfaces`.
    #[error("surface '{surface}': more surfaces than `max_surfaces` {max}")]
    TooManySurfaces { surface: String, max: usize },
    /// A session that has ended.
    #[error("surface '{surface}' of session '{found}', which has ended")]
    OtherSession { surface: String, found: String },
    /// A state of a surface that is older than what is there.
    #[error("surface '{surface}': older than what is there")]
    Stale { surface: String },
    /// A chunk that has come before.
    #[error("surface '{surface}': chunk {chunk} has come before")]
    Repeated { surface: String, chunk: u32 },
}

impl MeshRefusal {
    /// Name under which it is counted.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Frame { .. } => "frame",
            Self::Malformed { .. } => "malformed",
            Self::Mesh { error, .. } => error.name(),
            Self::TooManyTriangles { .. } => "too_many_triangles",
            Self::TooManySurfaces { .. } => "too_many_surfaces",
            Self::OtherSession { .. } => "other_session",
            Self::Stale { .. } => "stale",
            Self::Repeated { .. } => "repeated",
        }
    }
}

/// The first letters of a name from outside.
pub(super) fn shown(name: &str) -> String {
    name.chars().take(64).collect()
}
