//! Reasons for rejecting meshes.

use thiserror::Error;

use crate::mesh::MeshError;

/// Reason for rejecting a surface.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum MeshRefusal {
    /// Frame other than the headset's.
    #[error("surface in frame '{found}', expected '{expected}'")]
    Frame { found: String, expected: String },
    /// Inconsistent message.
    #[error("surface '{surface}': {problem}")]
    Malformed {
        surface: String,
        problem: &'static str,
    },
    /// Invalid triangles.
    #[error("surface '{surface}': {error}")]
    Mesh { surface: String, error: MeshError },
    /// Total triangles above `max_triangles`.
    #[error(
        "surface '{surface}': {triangles} triangles with the other surfaces, more than `max_triangles` {max}"
    )]
    TooManyTriangles {
        surface: String,
        triangles: usize,
        max: usize,
    },
    /// Surfaces above `max_surfaces`.
    #[error("surface '{surface}': more surfaces than `max_surfaces` {max}")]
    TooManySurfaces { surface: String, max: usize },
    /// Surface of an ended session.
    #[error("surface '{surface}' of session '{found}', which has ended")]
    OtherSession { surface: String, found: String },
    /// Surface state older than the current one.
    #[error("surface '{surface}': older than its current state")]
    Stale { surface: String },
    /// Duplicate chunk.
    #[error("surface '{surface}': duplicate chunk {chunk}")]
    Repeated { surface: String, chunk: u32 },
}

impl MeshRefusal {
    /// Counter name.
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

/// Foreign name, shortened.
pub(super) fn shown(name: &str) -> String {
    name.chars().take(64).collect()
}
