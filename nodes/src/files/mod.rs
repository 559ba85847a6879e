//! Point files in, pictures and meshes of maps out.

pub mod export;
pub mod points;
