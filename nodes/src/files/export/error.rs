//! Error of an export.

use thiserror::Error;

use crate::octree::OctreeError;

/// Reason for a failed export.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The system could not write.
    #[error("writing failed: {0}")]
    Io(#[from] std::io::Error),
    /// Vertex count above the limit of PLY, a signed 32-bit number.
    #[error(
        "the mesh has more than {} vertices: export the centres, or take larger cells",
        i32::MAX
    )]
    TooManyVertices,
    /// GeoTIFF that cannot be written.
    #[error("the GeoTIFF was not written: {0}")]
    Tiff(#[from] tiff::TiffError),
    /// Octree that cannot be made.
    #[error(transparent)]
    Octree(#[from] OctreeError),
}
