//! Error of an export.

use std::io;

use thiserror::Error;

/// Reason for which a map was not exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The system could not write.
    #[error("writing failed: {0}")]
    Io(#[from] io::Error),
    /// PLY counts vertices in 32 bits with sign.
    #[error(
        "the mesh has more than {} vertices: export the centres, or take larger cells",
        i32::MAX
    )]
    TooManyVertices,
}
