//! Triangle meshes with labels, and what rays hit of them.

mod error;
mod labelled;
mod obj;
mod ply;
mod scene;

pub use error::MeshError;
pub use labelled::{LabelledMesh, MAX_TRIANGLES};
pub use scene::{MeshHit, MeshScene};

use crate::files::points;
use crate::files::points::source::Source;
use std::path::Path;

/// Reads a mesh file with a class and an instance for each triangle: OBJ by its name, else PLY; also packed
/// with bzip2. An OBJ file has no classes.
pub fn read_mesh(path: &Path, max_triangles: usize) -> Result<LabelledMesh, MeshError> {
    let (reader, name) = points::open(path)?;
    let max_triangles = max_triangles.min(MAX_TRIANGLES);
    match name.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("obj") => {
            obj::read(reader, max_triangles)
        }
        _ => ply::read(&mut Source::new(reader), max_triangles),
    }
}
