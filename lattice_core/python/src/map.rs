//! `VoxelMap`.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::PathBuf;

use lattice_core::query::Query;
use lattice_core::voxels::file::{MapColumns, MapContents, WriteOptions, max_voxels_of};
use lattice_core::voxels::{InsertReport, Payload, VoxelList};
use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrow_table::{Table, map_of};
use crate::lattice::Lattice;
use crate::points::{Points, Rows, array_of, integers, labels as labels_of};
use crate::refuse;

/// Points that become offsets at a time.
const WAVE: usize = 1 << 20;

/// The occupied voxels of a lattice: counts, mean offsets, and if wanted stamps and labels.
#[pyclass(module = "lattice_core")]
pub struct VoxelMap {
    pub list: VoxelList,
}

#[pymethods]
impl VoxelMap {
    /// An empty map; its cells are counted from the one at `datum` (m).
    #[new]
    #[pyo3(signature = (lattice, datum=[0.0; 3], *, labels=false, stamps=false, max_voxels=usize::MAX))]
    fn new(
        lattice: &Lattice,
        datum: [f64; 3],
        labels: bool,
        stamps: bool,
        max_voxels: usize,
    ) -> PyResult<Self> {
        let list =
            VoxelList::new(lattice.core.clone(), datum.into(), max_voxels).map_err(refuse)?;
        let list = list.with_payload(Payload { stamps, labels });
        Ok(Self { list })
    }

    /// Adds points (m), with a label for each and a stamp (ns) for each or for all; says what became of
    /// them.
    #[pyo3(signature = (xyz, labels=None, stamps=None))]
    fn insert<'py>(
        &mut self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
        labels: Option<&Bound<'py, PyAny>>,
        stamps: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let points = Points::of(xyz)?;
        let rows = points.rows()?;
        let payload = self.list.payload();
        if labels.is_some() && !payload.labels {
            return Err(refuse("this map keeps no labels: make it with labels=True"));
        }
        if stamps.is_some() && !payload.stamps {
            return Err(refuse("this map keeps no stamps: make it with stamps=True"));
        }
        if stamps.is_none() && payload.stamps {
            return Err(refuse("this map keeps stamps: give stamps="));
        }
        let labels = match labels {
            Some(array) => labels_of(array, rows.len())?,
            None => Vec::new(),
        };
        let runs = match stamps {
            None => vec![(0, rows.len())],
            Some(stamps) => match stamps.extract::<i64>() {
                Ok(stamp_ns) => vec![(stamp_ns, rows.len())],
                Err(_) => runs(&integers(stamps, "stamps", rows.len())?),
            },
        };
        let list = &mut self.list;
        let report = py.detach(|| insert(list, &rows, &labels, &runs));
        let answer = PyDict::new(py);
        for (name, count) in [
            ("points", report.points),
            ("inserted", report.inserted),
            ("not_finite", report.not_finite),
            ("out_of_range", report.out_of_range),
            ("list_full", report.list_full),
            ("new_voxels", report.new_voxels),
        ] {
            answer.set_item(name, count)?;
        }
        Ok(answer)
    }

    /// Adds all voxels of another map of the same cells, exactly.
    fn merge(&mut self, py: Python<'_>, other: &VoxelMap) -> PyResult<()> {
        let (payload, max_voxels) = (self.list.payload(), self.list.max_voxels());
        let (list, other) = (&self.list, &other.list);
        let merged = py.detach(|| {
            let mut merged = MapContents::from_list(list);
            merged
                .merge(MapContents::from_list(other))
                .map_err(|error| error.to_string())?;
            let voxels = merged.keys().len();
            match voxels <= max_voxels {
                true => Ok(merged.into_list_with(payload, max_voxels)),
                false => Err(format!(
                    "{voxels} voxels are more than max_voxels, {max_voxels}"
                )),
            }
        });
        self.list = merged.map_err(refuse)?;
        Ok(())
    }

    /// The map as an Arrow table (`__arrow_c_stream__`), which pyarrow, Polars and DuckDB take.
    fn to_arrow(&self, py: Python<'_>) -> PyResult<Table> {
        py.detach(|| Table::of(&MapContents::from_list(&self.list)))
    }

    /// The map of an Arrow table that `to_arrow` made, in whatever order its rows are now.
    #[staticmethod]
    fn from_arrow(table: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::of(map_of(table)?))
    }

    /// Reads a map file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = || -> Result<MapContents, String> {
            let here = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
            let file = File::open(&path).map_err(|error| here(&error))?;
            let bytes = file.metadata().map_err(|error| here(&error))?.len();
            MapContents::read(BufReader::new(file), max_voxels_of(bytes))
                .map_err(|error| here(&error))
        };
        py.detach(read).map(Self::of).map_err(refuse)
    }

    /// Writes a map file, packed by zstd at a level from 1 to 19 if given.
    #[pyo3(signature = (path, zstd=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, zstd: Option<i32>) -> PyResult<()> {
        let options = WriteOptions {
            zstd_level: zstd,
            occupancy_only: false,
        };
        let write = || -> Result<(), String> {
            let here = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
            let file = File::create(&path).map_err(|error| here(&error))?;
            let map = MapContents::from_list(&self.list);
            map.write(BufWriter::new(file), &options)
                .map_err(|error| here(&error))
        };
        py.detach(write).map_err(refuse)
    }

    /// Distances (m), shape (n, k), and centres, shape (n, k, 3), of the `k` occupied cells nearest to
    /// each point; infinite and NaN where there are fewer.
    #[pyo3(signature = (xyz, k=1))]
    fn query<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
        k: usize,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let points = Points::of(xyz)?;
        let rows = points.rows()?;
        let count = rows.len();
        if k == 0 || count.saturating_mul(k) > 1 << 31 {
            return Err(refuse(format!(
                "{count} points with k = {k}: k is at least 1, and their product at most 2^31"
            )));
        }
        let found = py.detach(|| {
            let questions = Query::new(&self.list);
            let ask = |i: usize| questions.nearest(&Vector3::from(rows.get(i)), k);
            (0..count)
                .into_par_iter()
                .map(ask)
                .collect::<Result<Vec<_>, _>>()
        });
        let found = found.map_err(refuse)?;
        let (mut distances, mut centers) = (
            vec![[f64::INFINITY]; count * k],
            vec![[f64::NAN; 3]; count * k],
        );
        let places = distances.chunks_mut(k).zip(centers.chunks_mut(k));
        for (neighbors, (distances, centers)) in found.iter().zip(places) {
            for (near, (distance, center)) in
                neighbors.iter().zip(distances.iter_mut().zip(centers))
            {
                (*distance, *center) = ([near.distance_m], near.center_m.into());
            }
        }
        let shaped =
            |array: Bound<'py, PyAny>, shape: Vec<usize>| array.call_method1("reshape", (shape,));
        Ok((
            shaped(array_of(py, &distances)?, vec![count, k])?,
            shaped(array_of(py, &centers)?, vec![count, k, 3])?,
        ))
    }

    /// Centres of the occupied cells, shape (n, 3), m, in the order of `cells` and `counts`.
    fn centers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let map = self.columns(py);
        let center = |key| <[f64; 3]>::from(self.list.center_m(key));
        let centers: Vec<[f64; 3]> = map.keys.iter().copied().map(center).collect();
        array_of(py, &centers)
    }

    /// Lattice indices of the occupied cells, int64 of shape (n, 3).
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let map = self.columns(py);
        let datum = map.datum_index;
        let cell = |key: &lattice_core::lattice::MortonKey| {
            let w = key.unpack();
            [0, 1, 2].map(|i: usize| datum[i].saturating_add(w[i].into()))
        };
        let cells: Vec<[i64; 3]> = map.keys.iter().map(cell).collect();
        array_of(py, &cells)
    }

    /// Points in each occupied cell, shape (n,).
    fn counts<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let map = self.columns(py);
        let counts: Vec<u32> = map
            .voxels
            .iter()
            .flatten()
            .map(|voxel| voxel.count)
            .collect();
        numpy::PyArray1::from_vec(py, counts).into_any()
    }

    /// Lattice of the cells.
    #[getter]
    fn lattice(&self) -> Lattice {
        Lattice {
            core: self.list.lattice().clone(),
        }
    }

    /// Number of points that were inserted.
    #[getter]
    fn points(&self) -> u64 {
        self.list.distortion().points
    }

    fn __len__(&self) -> usize {
        self.list.len()
    }

    fn __repr__(&self) -> String {
        let lattice = self.list.lattice();
        format!(
            "<VoxelMap of {} {} voxels of {} m^3>",
            self.list.len(),
            lattice.kind().name(),
            lattice.cell_volume_m3()
        )
    }
}

impl VoxelMap {
    fn of(map: MapContents) -> VoxelMap {
        VoxelMap {
            list: map.into_list(usize::MAX),
        }
    }

    fn columns(&self, py: Python<'_>) -> MapColumns {
        py.detach(|| MapContents::from_list(&self.list).into())
    }
}

/// Lengths of the runs of equal values.
fn runs(values: &[i64]) -> Vec<(i64, usize)> {
    let runs = values.chunk_by(|a, b| a == b);
    runs.filter_map(|run| Some((*run.first()?, run.len())))
        .collect()
}

/// Inserts runs of points with one stamp each.
fn insert(
    list: &mut VoxelList,
    rows: &Rows,
    labels: &[u16],
    runs: &[(i64, usize)],
) -> InsertReport {
    let mut all = InsertReport::default();
    let datum_m = list.datum_m();
    let mut at = 0;
    for (stamp_ns, len) in runs {
        let labels = labels.get(at..at + len).unwrap_or_default();
        match rows {
            Rows::F32(rows) => {
                let rows = rows.get(at..at + len).unwrap_or_default();
                add(
                    &mut all,
                    &list.insert_offsets(*stamp_ns, Vector3::zeros(), rows, labels),
                );
            }
            Rows::F64(rows) => {
                let rows = rows.get(at..at + len).unwrap_or_default();
                for (number, rows) in rows.chunks(WAVE).enumerate() {
                    let offset =
                        |p: &[f64; 3]| [0, 1, 2].map(|i: usize| (p[i] - datum_m[i]) as f32);
                    let offsets: Vec<[f32; 3]> = rows.par_iter().map(offset).collect();
                    let from = (number * WAVE).min(labels.len());
                    let labels = labels.get(from..).unwrap_or_default();
                    add(
                        &mut all,
                        &list.insert_offsets(*stamp_ns, datum_m, &offsets, labels),
                    );
                }
            }
        }
        at += len;
    }
    all
}

fn add(all: &mut InsertReport, more: &InsertReport) {
    all.points += more.points;
    all.inserted += more.inserted;
    all.not_finite += more.not_finite;
    all.out_of_range += more.out_of_range;
    all.list_full += more.list_full;
    all.new_voxels += more.new_voxels;
}
