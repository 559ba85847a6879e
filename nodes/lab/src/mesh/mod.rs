//! Triangle meshes with labels, and what rays hit of them.

mod file;
mod labelled;
mod scene;

pub use file::read_mesh;
pub use labelled::{LabelledMesh, MAX_COORDINATE_M, MAX_TRIANGLES};
pub use scene::{MeshHit, MeshScene};
