//! Input of point files, labelled clouds, meshes and class names; export of images and meshes of maps.

pub mod atomic_write;
pub mod classes;
pub mod export;
pub mod points;
#[cfg(any(feature = "onnx", feature = "viewer"))]
pub(crate) mod regular_file;
pub mod semantic;
