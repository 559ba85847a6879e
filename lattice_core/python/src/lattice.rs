//! `Lattice`.

use std::hash::{DefaultHasher, Hash, Hasher};

use lattice_core::lattice::{BatchQuantizer, Lattice as Core, LatticeIndex, LatticeKind};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use nalgebra::{Isometry3, Vector3};
use numpy::{Ix2, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;

use crate::arrays::{empty, expect_out, rows_of};
use crate::errors::{mistyped, refuse};
use crate::pickle::Reduced;
use crate::points::{Points, Rows, mask_of, shape_of};
use crate::threads::step;

/// Rows per task.
const PART: usize = 1 << 14;
/// Rows between two checks for signals, 0.1 s of one thread.
const STEP: usize = 1 << 22;

/// Lattice of cells of one volume: cubic, bcc, fcc, mcc, hex or hexopt.
#[pyclass(frozen, module = "lattice_core")]
pub struct Lattice {
    pub core: Core,
}

#[pymethods]
impl Lattice {
    /// Creates a lattice by name with cells of `volume` m^3.
    #[new]
    fn new(name: &str, volume: f64) -> PyResult<Self> {
        let kind: LatticeKind = name.parse().map_err(refuse)?;
        let core = Core::new(kind, volume).map_err(refuse)?;
        Ok(Self { core })
    }

    /// Name of the lattice.
    #[getter]
    fn name(&self) -> &'static str {
        self.core.kind().name()
    }

    /// Volume of a cell, m^3.
    #[getter]
    fn cell_volume_m3(&self) -> f64 {
        self.core.cell_volume_m3()
    }

    /// Generator matrix, shape (3, 3), columns are basis vectors in m.
    #[getter]
    fn generator<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let g = self.core.generator();
        let row = |i: usize| [g[(i, 0)], g[(i, 1)], g[(i, 2)]];
        rows_of(py, &[row(0), row(1), row(2)])
    }

    /// Lattice indices of the cells of points (m), int32 of shape (n, 3); written to `out` if given.
    #[pyo3(signature = (xyz, *, out=None))]
    fn quantize<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let points = Points::of(xyz)?;
        let rows = points.rows()?;
        let array = match out {
            Some(out) => expect_out(out, rows.len())?.clone(),
            None => empty::<i32, Ix2>(py, &[rows.len(), 3])?,
        };
        self.quantize_into(py, rows, &array)?;
        Ok(array.into_any())
    }

    /// Centres of cells by their lattice indices, float64 of shape (n, 3), m.
    fn centers<'py>(
        &self,
        py: Python<'py>,
        cells: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let cells = indices(cells)?;
        let cells = cells.as_slice().map_err(refuse)?.as_chunks::<3>().0;
        let array = empty::<f64, Ix2>(py, &[cells.len(), 3])?;
        {
            let mut centers = array.try_readwrite().map_err(refuse)?;
            let centers = centers.as_slice_mut().map_err(refuse)?.as_chunks_mut().0;
            for (cells, centers) in cells.chunks(STEP).zip(centers.chunks_mut(STEP)) {
                step(py, || {
                    let each = cells.par_iter().zip(centers).with_min_len(PART);
                    each.for_each(|(w, center)| *center = self.core.center_wide(*w).into());
                })?;
            }
        }
        Ok(array.into_any())
    }

    fn __repr__(&self) -> String {
        let (name, volume) = (self.name(), self.cell_volume_m3());
        format!("Lattice({name:?}, {volume})")
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.core == other.core
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.name().hash(&mut hasher);
        self.cell_volume_m3().to_bits().hash(&mut hasher);
        hasher.finish()
    }

    /// Pickles as the file of an empty map, which keeps the orientation and the basis.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py> {
        let list = VoxelList::new(slf.get().core.clone(), Vector3::zeros(), 0).map_err(refuse)?;
        let mut bytes = Vec::new();
        let map = MapContents::from_list(&list);
        map.write(&mut bytes, &WriteOptions::default())
            .map_err(refuse)?;
        let restore = slf.get_type().getattr("_restore")?;
        let arguments = (PyBytes::new(slf.py(), &bytes),);
        Ok((restore, arguments.into_pyobject(slf.py())?))
    }

    #[staticmethod]
    fn _restore(bytes: &[u8]) -> PyResult<Self> {
        let map = MapContents::read(bytes, 0).map_err(refuse)?;
        let core = map.lattice().clone();
        Ok(Self { core })
    }
}

impl Lattice {
    fn quantize_into(
        &self,
        py: Python<'_>,
        rows: Rows,
        array: &Bound<'_, PyArray2<i32>>,
    ) -> PyResult<()> {
        let why = |error| {
            refuse(format!(
                "out is not writable: {error}; or it shares memory with xyz"
            ))
        };
        let mut cells = array.try_readwrite().map_err(why)?;
        let cells = cells.as_slice_mut().map_err(refuse)?.as_chunks_mut().0;
        for (number, cells) in cells.chunks_mut(STEP).enumerate() {
            let start = number * STEP;
            let bad = match rows.len() > PART {
                true => step(py, || self.quantize_rows(rows.part(start, STEP), cells))?,
                false => py.detach(|| self.quantize_part(rows, cells)),
            };
            if let Some(row) = bad {
                let row = start + row;
                let point = rows.get(row);
                return Err(refuse(format!(
                    "row {row}: point {point:?} is not finite or more than 2^20 cells from the origin: subtract a \
                     datum, or insert into a VoxelMap with one"
                )));
            }
        }
        Ok(())
    }

    /// Writes the cells of the rows, on all threads; returns the first row without a cell.
    fn quantize_rows(&self, rows: Rows, cells: &mut [LatticeIndex]) -> Option<usize> {
        let parts = cells.par_chunks_mut(PART).enumerate();
        let first_bad = parts.filter_map(|(number, cells)| {
            let start = number * PART;
            Some(start + self.quantize_part(rows.part(start, PART), cells)?)
        });
        first_bad.min()
    }

    fn quantize_part(&self, rows: Rows, cells: &mut [LatticeIndex]) -> Option<usize> {
        match rows {
            Rows::F32(rows) => {
                BatchQuantizer::new(&self.core, Isometry3::identity()).indices(rows, cells)
            }
            Rows::F64(rows) => self.exactly(rows, cells),
        }
    }

    /// Writes the cells of rows in double precision, one at a time; returns the first row without a cell.
    fn exactly(&self, rows: &[[f64; 3]], cells: &mut [LatticeIndex]) -> Option<usize> {
        let (mut bad, mut to) = (None, cells.iter_mut().enumerate());
        self.core.quantize_each(rows.iter().copied(), |_, cell| {
            let Some((row, to)) = to.next() else { return };
            match cell {
                Some(cell) => *to = cell,
                None => bad = bad.or(Some(row)),
            }
        });
        bad
    }
}

/// Validates lattice indices of shape (n, 3).
fn indices<'py>(cells: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray2<'py, i64>> {
    let numpy = cells.py().import("numpy")?;
    if mask_of(cells)?.is_some() {
        return Err(refuse("cells are a masked array; pass the unmasked rows"));
    }
    let cells = numpy.call_method1("asarray", (cells,))?;
    let shape = shape_of(&cells)?;
    if shape.len() != 2 || shape.get(1) != Some(&3) {
        return Err(refuse(format!("cells have shape {shape:?}, not (n, 3)")));
    }
    let dtype = cells.getattr("dtype")?;
    if !numpy
        .call_method1("can_cast", (&dtype, "int64"))?
        .is_truthy()?
    {
        return Err(mistyped(format!(
            "cells are of {dtype}, not int32 or int64"
        )));
    }
    let cells = numpy.call_method1("require", (cells, "int64", ["C", "A"]))?;
    cells.extract()
}
