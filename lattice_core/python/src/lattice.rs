//! `Lattice`.

use lattice_core::lattice::{BatchQuantizer, Lattice as Core, LatticeIndex, LatticeKind};
use nalgebra::Isometry3;
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::points::{Points, Rows, array_of, new_array};
use crate::refuse;

/// Rows that a thread takes at a time.
const PART: usize = 1 << 14;

/// A lattice of cells of one volume: cubic, bcc, fcc, mcc, hex or hexopt.
#[pyclass(frozen, module = "lattice_core")]
pub struct Lattice {
    pub core: Core,
}

#[pymethods]
impl Lattice {
    /// Cells of `volume` m^3 of the lattice with this name.
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
        array_of(py, &[row(0), row(1), row(2)])
    }

    /// Lattice indices of the cells of points (m), int32 of shape (n, 3); into `out` where given.
    #[pyo3(signature = (xyz, *, out=None))]
    fn quantize<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let points = Points::of(xyz)?;
        let rows = points.rows()?;
        let run = |cells: &mut [LatticeIndex]| self.quantize_rows(&rows, cells);
        let (cells, bad) = match out {
            Some(out) => {
                let bad = into_array(&out, rows.len(), run)?;
                (out, bad)
            }
            None => new_array(py, rows.len(), run)?,
        };
        if let Some(row) = bad {
            let point = rows.get(row);
            return Err(refuse(format!(
                "row {row}: point {point:?} is not finite or more than 2^20 cells from the origin"
            )));
        }
        Ok(cells)
    }

    /// Centres of cells by their lattice indices, float64 of shape (n, 3), m.
    fn centers<'py>(
        &self,
        py: Python<'py>,
        cells: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let numpy = py.import("numpy")?;
        let cells = numpy.call_method1("ascontiguousarray", (cells, "int64"))?;
        let cells: PyReadonlyArray2<i64> = cells
            .extract()
            .map_err(|_| refuse("cells are not rows of three integers"))?;
        let cells = cells.as_slice().map_err(refuse)?.as_chunks::<3>().0;
        let fill = |centers: &mut [[f64; 3]]| {
            let each = cells.par_iter().zip(centers).with_min_len(PART);
            each.for_each(|(w, center)| *center = self.core.center_wide(*w).into());
        };
        Ok(new_array(py, cells.len(), fill)?.0)
    }

    fn __repr__(&self) -> String {
        let (name, volume) = (self.name(), self.cell_volume_m3());
        format!("Lattice({name:?}, {volume})")
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.core == other.core
    }
}

impl Lattice {
    /// Writes the cells of the rows; the first row that is in none.
    fn quantize_rows(&self, rows: &Rows, cells: &mut [LatticeIndex]) -> Option<usize> {
        match rows {
            Rows::F32(rows) => {
                let batch = BatchQuantizer::new(&self.core, Isometry3::identity());
                by_parts(rows, cells, |rows, cells| batch.indices(rows, cells))
            }
            Rows::F64(rows) => by_parts(rows, cells, |rows, cells| self.exactly(rows, cells)),
        }
    }

    /// Writes the cells of rows in double precision, one at a time; the first row that is in none.
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

/// Runs parts of the rows on all threads; the first row of all that a part gives.
fn by_parts<T: Sync>(
    rows: &[T],
    cells: &mut [LatticeIndex],
    run: impl Fn(&[T], &mut [LatticeIndex]) -> Option<usize> + Sync,
) -> Option<usize> {
    let parts = rows.par_chunks(PART).zip(cells.par_chunks_mut(PART));
    let first_bad = parts
        .enumerate()
        .filter_map(|(number, (rows, cells))| Some(number * PART + run(rows, cells)?));
    first_bad.min()
}

/// Lets `fill` write the rows of an array of the caller without the GIL.
fn into_array<R: Send>(
    out: &Bound<'_, PyAny>,
    len: usize,
    fill: impl FnOnce(&mut [LatticeIndex]) -> R + Send,
) -> PyResult<R> {
    let array = out
        .cast::<PyArray2<i32>>()
        .map_err(|_| refuse("out is not an array of int32 of shape (n, 3)"))?;
    let shape = array.shape();
    if shape != [len, 3] {
        return Err(refuse(format!("out has shape {shape:?}, not ({len}, 3)")));
    }
    let not = |why: &dyn std::fmt::Display| refuse(format!("out cannot be written: {why}"));
    let mut rows = array.try_readwrite().map_err(|why| not(&why))?;
    let rows = rows.as_slice_mut().map_err(|why| not(&why))?;
    Ok(out.py().detach(|| fill(rows.as_chunks_mut().0)))
}
