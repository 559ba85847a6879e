//! Parameters of the mapper.

use lattice_core::lattice::{Lattice, LatticeKind};
use nalgebra::Vector3;

use crate::runtime::params::{ParamError, Params};

/// Everything that a [`super::LatticeMapper`] can be told.
#[derive(Clone, Debug)]
pub struct MapperOptions {
    /// Lattice and cell volume.
    pub lattice: Lattice,
    /// Frame that clouds must be in and that the map is in.
    pub map_frame: String,
    /// Place in the map frame near which voxel keys are counted from, in metres.
    pub datum_near_m: Vector3<f64>,
    /// Most voxels kept; further ones are refused and counted.
    pub max_voxels: usize,
    /// Most points of one cloud.
    pub max_cloud_points: usize,
    /// Largest serialised message of `map` and `map_updates`.
    pub chunk_bytes: usize,
}

impl MapperOptions {
    /// Defaults for a lattice: frame `map`, datum at its origin.
    pub fn new(lattice: Lattice) -> Self {
        Self {
            lattice,
            map_frame: "map".into(),
            datum_near_m: Vector3::zeros(),
            max_voxels: 20_000_000,
            max_cloud_points: 4_000_000,
            chunk_bytes: 60_000,
        }
    }

    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let name = params.string("lattice", "fcc")?;
        let kind: LatticeKind = name
            .parse()
            .map_err(|e| params.invalid("lattice", format!("{e}")))?;
        let lattice = Lattice::new(kind, params.f64("cell_volume_m3", 0.125)?)
            .map_err(|e| params.invalid("cell_volume_m3", format!("{e}")))?;
        let defaults = Self::new(lattice);
        let datum = params.f64_array("datum_m", &[0.0; 3])?;
        let [x, y, z] = datum[..] else {
            return Err(params.invalid("datum_m", "expected three numbers, x y z in metres"));
        };
        Ok(Self {
            map_frame: params.string("map_frame", &defaults.map_frame)?,
            datum_near_m: Vector3::new(x, y, z),
            max_voxels: params.usize("max_voxels", defaults.max_voxels)?,
            max_cloud_points: params.usize("max_cloud_points", defaults.max_cloud_points)?,
            chunk_bytes: params.usize("chunk_bytes", defaults.chunk_bytes)?,
            ..defaults
        })
    }
}
