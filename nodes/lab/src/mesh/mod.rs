//! Triangle meshes with labels, and what rays hit of them.

mod file;
mod labelled;
mod scene;

pub use file::read_mesh;
pub(crate) use labelled::{LabelledMesh, MAX_TRIANGLES};
pub(crate) use scene::MeshScene;
