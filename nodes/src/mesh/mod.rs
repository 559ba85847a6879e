//! Labelled triangle meshes, and ray casting on them.

mod error;
pub mod gltf;
mod labelled;
mod obj;
mod ply;
mod scene;

pub use error::MeshError;
pub use labelled::{LabelledMesh, MAX_TRIANGLES};
pub use scene::{MeshHit, MeshScene};

use crate::files::points;
use crate::files::points::source::Source;
use lattice_core::pose::Axes;
use std::path::Path;

/// Reads a mesh file with a class and an instance per triangle: OBJ and glTF by extension, else PLY;
/// also compressed with bzip2. OBJ files have no classes.
///
/// PLY and OBJ coordinates are unchanged; glTF, with y up by definition, is converted to z up.
pub fn read_mesh(path: &Path, max_triangles: usize) -> Result<LabelledMesh, MeshError> {
    read_mesh_in(path, Axes::RosFlu, max_triangles)
}

/// Reads a mesh file into the given axes. glTF files are converted to them, see [`gltf::from_bytes`]; PLY and OBJ
/// files are assumed to have them.
pub fn read_mesh_in(
    path: &Path,
    axes: Axes,
    max_triangles: usize,
) -> Result<LabelledMesh, MeshError> {
    let (reader, name) = points::open(path)?;
    let max_triangles = max_triangles.min(MAX_TRIANGLES);
    let is = |ending: &str| {
        let found = name.extension();
        found.is_some_and(|found| found.eq_ignore_ascii_case(ending))
    };
    if is("obj") {
        obj::read(reader, max_triangles)
    } else if is("glb") || is("gltf") {
        let folder = path
            .parent()
            .map(|folder| match folder.as_os_str().is_empty() {
                true => Path::new("."),
                false => folder,
            });
        gltf::read(reader, folder, axes, max_triangles)
    } else {
        ply::read(&mut Source::new(reader), max_triangles)
    }
}
