//! `Lattice`.

use lattice_core::lattice::{Lattice as Core, LatticeKind};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::points::{Points, Rows, array_of};
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

    /// Lattice indices of the cells of points (m), int32 of shape (n, 3).
    fn quantize<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let points = Points::of(xyz)?;
        let rows = points.rows()?;
        let (cells, bad) = py.detach(|| self.quantize_rows(&rows));
        if let Some(row) = bad {
            let point = rows.get(row);
            return Err(refuse(format!(
                "row {row}: point {point:?} is not finite or more than 2^20 cells from the origin"
            )));
        }
        array_of(py, &cells)
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
        let center = |w: &[i64; 3]| <[f64; 3]>::from(self.core.center_wide(*w));
        let centers: Vec<[f64; 3]> = py.detach(|| cells.par_iter().map(center).collect());
        array_of(py, &centers)
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
    /// The cells, and the first row that is in none.
    fn quantize_rows(&self, rows: &Rows) -> (Vec<[i32; 3]>, Option<usize>) {
        let mut cells = vec![[0; 3]; rows.len()];
        let bad = match rows {
            Rows::F32(rows) => self.each(rows, &mut cells, |row| row.map(f64::from)),
            Rows::F64(rows) => self.each(rows, &mut cells, |row| *row),
        };
        (cells, bad)
    }

    fn each<T: Sync>(
        &self,
        rows: &[[T; 3]],
        cells: &mut [[i32; 3]],
        wide: impl Fn(&[T; 3]) -> [f64; 3] + Sync,
    ) -> Option<usize> {
        let parts = rows.par_chunks(PART).zip(cells.par_chunks_mut(PART));
        let first_bad = parts.enumerate().filter_map(|(number, (rows, cells))| {
            let (mut bad, mut at) = (None, 0);
            self.core.quantize_each(rows.iter().map(&wide), |_, cell| {
                match (cell, cells.get_mut(at)) {
                    (Some(cell), Some(to)) => *to = cell,
                    _ => bad = bad.or(Some(number * PART + at)),
                }
                at += 1;
            });
            bad
        });
        first_bad.min()
    }
}
