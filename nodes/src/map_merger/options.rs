//! Options of the merger.

use nalgebra::Vector3;

/// Options of a merger.
#[derive(Clone, PartialEq, Debug)]
pub struct MergerOptions {
    /// Names of the robots: their maps are `/NAME/voxel_map`.
    pub robots: Vec<String>,
    /// Frame that all maps must be in.
    pub map_frame: String,
    /// Origin of the keys: the lattice point nearest to this position, map frame; metres.
    pub datum_m: Vector3<f64>,
    /// Voxel limit of the merged map, and of each robot's.
    pub max_voxels: usize,
    /// Labels of the merged map.
    pub labels: MergedLabels,
    /// Largest message, bytes.
    pub chunk_bytes: usize,
}

/// Labels of a merged map.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MergedLabels {
    /// No labels.
    None,
    /// Labels of the robots' maps.
    Own,
    /// One label per robot: 0 is the first, weighted by its points in the voxel.
    Robots,
}
