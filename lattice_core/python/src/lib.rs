//! Python package of the core: lattices, voxel maps, registration.
//!
//! Points come as NumPy arrays, which are read where they are; the GIL is free while Rust works.

mod arrow_table;
mod lattice;
mod map;
mod points;
mod registration;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Any refusal, as the ValueError that Python sees.
fn refuse(reason: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(reason.to_string())
}

/// Occupied voxel maps on lattices, and registration.
#[pymodule]
mod lattice_core {
    #[pymodule_export]
    use crate::arrow_table::Table;
    #[pymodule_export]
    use crate::lattice::Lattice;
    #[pymodule_export]
    use crate::map::VoxelMap;
    #[pymodule_export]
    use crate::registration::{Calibration, Registration, calibrate, gicp};
}
