//! Python package of the core: lattices, voxel maps, registration.
//!
//! NumPy arrays are borrowed without a copy; the GIL is released while Rust works.

mod arrays;
mod arrow_columns;
mod arrow_read;
mod arrow_table;
mod calibration;
mod columns;
mod errors;
mod insert;
mod lattice;
mod map;
mod map_arrays;
mod map_files;
mod pickle;
mod point_files;
mod points;
mod pose;
mod query;
mod registration;
mod shared_list;
mod threads;

use pyo3::prelude::*;

/// Occupied voxel maps on lattices, and registration.
#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::arrow_table::Table;
    #[pymodule_export]
    use crate::calibration::{Calibration, calibrate};
    #[pymodule_export]
    use crate::lattice::Lattice;
    #[pymodule_export]
    use crate::map::VoxelMap;
    #[pymodule_export]
    use crate::point_files::{read_points, write_points};
    #[pymodule_export]
    use crate::registration::{Registration, gicp};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
