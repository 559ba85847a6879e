//! Triangle meshes with labels, and what rays hit of them.

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

/// Reads a mesh file with a class and an instance for each triangle: OBJ and glTF by their names, else PLY;
/// also packed with bzip2. An OBJ file has no classes.
///
/// PLY and OBJ files are taken as they stand; glTF, in which y is up by definition, is turned to z up.
pub fn read_mesh(path: &Path, max_triangles: usize) -> Result<LabelledMesh, MeshError> {
    read_mesh_in(path, Axes::RosFlu, max_triangles)
}

/// The same for who expects a mesh in these axes: those of glTF become these, as
/// [`gltf::from_bytes`] says; PLY and OBJ files have them.
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
