//! Point files, labelled clouds, meshes and class names in, pictures and meshes of maps out.

pub mod atomic_write;
pub mod classes;
pub mod export;
pub mod points;
pub mod semantic;
