//! `VoxelMap`.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use lattice_core::query::Shells;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_core::voxels::{Payload, Region, VoxelList};
use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrow_read::{Cells, map_of};
use crate::arrow_table::Table;
use crate::errors::refuse;
use crate::lattice::Lattice;
use crate::pickle::Reduced;
use crate::shared_list::SharedList;
use crate::threads::{background, on_pool};
use crate::{insert, map_arrays, map_files, query};

/// Bound of the datum coordinates, m: offsets of 2^-20 m from it are exact in double precision.
const MAX_DATUM_M: f64 = (1_u64 << 31) as f64;

/// Occupied voxels of a lattice: counts, mean offsets and optional stamps, labels and colours.
#[pyclass(frozen, module = "lattice_core")]
pub struct VoxelMap {
    pub list: SharedList,
    lattice: lattice_core::lattice::Lattice,
    shells: OnceLock<Arc<Shells>>,
}

#[pymethods]
impl VoxelMap {
    /// Creates an empty map; its cells count from the one at `datum` (m).
    #[new]
    #[pyo3(signature = (lattice, datum=[0.0; 3], *, labels=false, stamps=false, colors=false, max_voxels=usize::MAX))]
    fn new(
        lattice: &Lattice,
        datum: [f64; 3],
        labels: bool,
        stamps: bool,
        colors: bool,
        max_voxels: usize,
    ) -> PyResult<Self> {
        if datum.iter().any(|metres| metres.abs() >= MAX_DATUM_M) {
            return Err(refuse(format!("datum {datum:?} m is not within 2^31 m")));
        }
        let list = VoxelList::new(lattice.core.clone(), datum.into(), max_voxels);
        let list = list.map_err(refuse)?.with_payload(Payload {
            stamps,
            labels,
            color: colors,
        });
        Ok(Self::of(list))
    }

    /// Adds points (m), with one label and colour per point and a stamp per point or for all; returns the counts of the
    /// outcomes.
    #[pyo3(signature = (xyz, labels=None, stamps=None, colors=None))]
    fn insert<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
        labels: Option<&Bound<'py, PyAny>>,
        stamps: Option<&Bound<'py, PyAny>>,
        colors: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        insert::insert(py, &self.list, xyz, labels, stamps, colors)
    }

    /// Adds all voxels of another map of the same cells, exactly.
    fn merge(&self, py: Python<'_>, other: &VoxelMap) -> PyResult<()> {
        let (list, other) = (self.list.clone(), other.list.clone());
        background(py, move |stop| {
            // Only one lock is held at a time.
            let other = other.copied()?;
            list.write_away(|list| {
                let merged = on_pool(|| merged(list, other))??;
                if !stop.is_set() {
                    *list = merged;
                }
                Ok(())
            })
        })?
    }

    /// Map of the voxels whose centres are in the closed box between two corners (m).
    fn crop(&self, py: Python<'_>, low: [f64; 3], high: [f64; 3]) -> PyResult<Self> {
        let region = Region::cuboid(low.into(), high.into()).map_err(refuse)?;
        let list = self.list.clone();
        let cropped = background(py, move |_| {
            let (payload, most) = list.read_away(|list| (list.payload(), list.max_voxels()));
            let mut map = list.copied()?;
            map.retain(|_, center_m| region.contains(&center_m));
            on_pool(|| map.into_list_with(payload, most))
        })??;
        Ok(Self::of(cropped))
    }

    /// Converts to an Arrow table (`__arrow_c_stream__`) for pyarrow, Polars and DuckDB.
    fn to_arrow(&self, py: Python<'_>) -> PyResult<Table> {
        let list = self.list.clone();
        background(py, move |_| Table::of(list.copied()?))?
    }

    /// Creates a map from an Arrow table of cells in any order, such as that of `to_arrow`.
    ///
    /// `lattice`, and optionally `datum` (m), replace metadata that an engine has dropped.
    #[staticmethod]
    #[pyo3(signature = (table, *, lattice=None, datum=None))]
    fn from_arrow(
        py: Python<'_>,
        table: &Bound<'_, PyAny>,
        lattice: Option<&Lattice>,
        datum: Option<[f64; 3]>,
    ) -> PyResult<Self> {
        let cells = Cells {
            lattice: lattice.map(|lattice| lattice.core.clone()),
            datum_m: datum.map(Vector3::from),
        };
        let map = map_of(py, table, cells)?;
        Self::of_contents(py, map)
    }

    /// Reads a map file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let map = background(py, move |stop| map_files::load(&path, stop))??;
        Self::of_contents(py, map)
    }

    /// Writes a map file, compressed by zstd at a level from 1 to 19 if given; after an error the previous file
    /// stays.
    #[pyo3(signature = (path, zstd=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, zstd: Option<i32>) -> PyResult<()> {
        let options = WriteOptions {
            zstd_level: zstd,
            occupancy_only: false,
        };
        let list = self.list.clone();
        background(py, move |stop| {
            map_files::save(&list.copied()?, &path, &options, stop)
        })?
    }

    /// Distances (m), shape (n, k), and centres, shape (n, k, 3), of the `k` occupied cells nearest to each point;
    /// fewer if there are fewer cells.
    #[pyo3(signature = (xyz, k=1))]
    fn query<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
        k: i64,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let most = usize::try_from(k).ok().filter(|k| *k > 0);
        let k = most.ok_or_else(|| refuse(format!("k = {k} is below 1")))?;
        let shells = || Arc::new(Shells::new(&self.lattice));
        let shells = self.shells.get_or_init(shells).clone();
        query::query(py, &self.list, shells, xyz, k)
    }

    /// Centres of the occupied cells, shape (n, 3), m, in the order of `cells` and the other columns.
    fn centers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::centers(py, &self.list)
    }

    /// Lattice indices of the occupied cells, int64 of shape (n, 3).
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::cells(py, &self.list)
    }

    /// Number of points in each occupied cell, uint32 of shape (n,).
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::counts(py, &self.list)
    }

    /// Mean of the points of each occupied cell, shape (n, 3), m.
    fn means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::means(py, &self.list)
    }

    /// Most frequent label of each occupied cell, the smallest of equals, int32 of shape (n,); -1 without labels.
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::labels(py, &self.list)
    }

    /// Stamps of the first and the last point of each occupied cell, datetime64[ns] of shape (n, 2); NaT without stamps.
    fn stamps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::stamps(py, &self.list)
    }

    /// Mean red, green and blue of the coloured points of each occupied cell, uint8 of shape (n, 3); 0 without them.
    fn colors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::colors(py, &self.list)
    }

    /// Number of coloured points in each occupied cell, uint32 of shape (n,).
    fn color_counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        map_arrays::color_counts(py, &self.list)
    }

    /// Lattice of the cells.
    #[getter]
    fn lattice(&self) -> Lattice {
        Lattice {
            core: self.lattice.clone(),
        }
    }

    /// Datum: centre of the cell that indices count from, m.
    #[getter]
    fn datum(&self, py: Python<'_>) -> PyResult<(f64, f64, f64)> {
        let [x, y, z] = self.list.read(py, |list| list.datum_m().into())?;
        Ok((x, y, z))
    }

    /// Number of inserted points.
    #[getter]
    fn points(&self, py: Python<'_>) -> PyResult<u64> {
        self.list.read(py, |list| list.distortion().points)
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.list.read(py, VoxelList::len)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (name, volume) = (self.lattice.kind().name(), self.lattice.cell_volume_m3());
        let voxels = self.__len__(py)?;
        Ok(format!(
            "<VoxelMap of {voxels} {name} voxels of {volume} m^3>"
        ))
    }

    /// Tests whether two maps have the same voxels and datum.
    fn __eq__(&self, py: Python<'_>, other: &VoxelMap) -> PyResult<bool> {
        let (ours, theirs) = (self.list.clone(), other.list.clone());
        background(py, move |_| {
            Ok(map_arrays::rows(&ours)? == map_arrays::rows(&theirs)?)
        })?
    }

    /// Pickles as a map file and the limit of its voxels.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py> {
        let py = slf.py();
        let list = slf.get().list.clone();
        let (bytes, most) = background(py, move |_| {
            let mut bytes = Vec::new();
            let written = list.copied()?.write(&mut bytes, &WriteOptions::default());
            written.map_err(refuse)?;
            Ok::<_, PyErr>((bytes, list.read_away(VoxelList::max_voxels)))
        })??;
        let restore = slf.get_type().getattr("_restore")?;
        let arguments = (PyBytes::new(py, &bytes), most);
        Ok((restore, arguments.into_pyobject(py)?))
    }

    #[staticmethod]
    fn _restore(bytes: &[u8], max_voxels: usize) -> PyResult<Self> {
        let map = MapContents::read(bytes, max_voxels).map_err(refuse)?;
        Ok(Self::of(on_pool(|| map.into_list(max_voxels))?))
    }
}

impl VoxelMap {
    fn of(list: VoxelList) -> VoxelMap {
        VoxelMap {
            lattice: list.lattice().clone(),
            list: SharedList::new(list),
            shells: OnceLock::new(),
        }
    }

    fn of_contents(py: Python<'_>, map: MapContents) -> PyResult<VoxelMap> {
        let list = background(py, move |_| on_pool(|| map.into_list(usize::MAX)))??;
        Ok(Self::of(list))
    }
}

fn merged(list: &VoxelList, other: MapContents) -> PyResult<VoxelList> {
    let mut merged = MapContents::from_list(list);
    merged.merge(other).map_err(refuse)?;
    let (voxels, most) = (merged.keys().len(), list.max_voxels());
    match voxels <= most {
        true => Ok(merged.into_list_with(list.payload(), most)),
        false => Err(refuse(format!(
            "voxel count {voxels} is above max_voxels {most}"
        ))),
    }
}
