//! Columns of a map as NumPy arrays, one row per occupied cell in key order.

use lattice_core::lattice::MortonKey;
use lattice_core::registration::UNLABELED;
use lattice_core::voxels::file::{MapColumns, MapContents};
use lattice_core::voxels::{ColorSum, DistortionSums, LabelCount, Stamps};
use nalgebra::Vector3;
use numpy::{Ix1, Ix2};
use pyo3::prelude::*;

use crate::arrays::{array_of, rows_of};
use crate::errors::refuse;
use crate::shared_list::SharedList;
use crate::threads::background;

/// Centres, m.
pub fn centers<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let centers = of_map(py, list, |map| {
        let center = |key: &MortonKey| <[f64; 3]>::from(map.center_m(*key));
        Ok(map.keys().iter().map(center).collect::<Vec<_>>())
    })?;
    rows_of(py, &centers)
}

/// Lattice indices.
pub fn cells<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let cells = of_map(py, list, |map| {
        let datum = map.datum_index();
        let cell = |key: &MortonKey| {
            let w = key.unpack();
            [0, 1, 2].map(|i: usize| datum[i].saturating_add(w[i].into()))
        };
        Ok(map.keys().iter().map(cell).collect::<Vec<_>>())
    })?;
    rows_of(py, &cells)
}

/// Number of points in each cell.
pub fn counts<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let counts = of_map(py, list, |map| {
        let voxels = map.voxels().unwrap_or_default().iter();
        Ok(voxels.map(|voxel| voxel.count).collect::<Vec<_>>())
    })?;
    array_of::<u32, Ix1>(py, &[counts.len()], &counts)
}

/// Means of the points of each cell, m.
pub fn means<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let means = of_map(py, list, |map| {
        let voxels = map.voxels().unwrap_or_default().iter();
        let mean = map.keys().iter().zip(voxels).map(|(key, voxel)| {
            let offset_m = Vector3::from(voxel.mean_offset_m());
            <[f64; 3]>::from(map.center_m(*key) + offset_m)
        });
        Ok(mean.collect::<Vec<_>>())
    })?;
    rows_of(py, &means)
}

/// Most frequent label of each cell; -1 without one.
pub fn labels<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let labels = of_map(py, list, |map| {
        let columns = MapColumns::from(map);
        let labels = columns
            .labels
            .ok_or_else(|| refuse("this map keeps no labels: maps made with labels=True do"))?;
        let most = |of_cell: &Vec<LabelCount>| {
            let by_count = |known: &&LabelCount| (std::cmp::Reverse(known.count), known.label);
            let most = of_cell.iter().min_by_key(by_count);
            let most = most.filter(|known| known.label != UNLABELED);
            most.map_or(-1, |known| i32::from(known.label))
        };
        Ok(labels.iter().map(most).collect::<Vec<_>>())
    })?;
    array_of::<i32, Ix1>(py, &[labels.len()], &labels)
}

/// Mean colours of each cell; 0 without coloured points.
pub fn colors<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let colors = of_map(py, list, |map| {
        let mean = |color: &ColorSum| color.mean().unwrap_or_default();
        Ok(color_sums(map)?.iter().map(mean).collect::<Vec<_>>())
    })?;
    array_of::<u8, Ix2>(py, &[colors.len(), 3], colors.as_flattened())
}

/// Number of coloured points of each cell.
pub fn color_counts<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let counts = of_map(py, list, |map| {
        Ok(color_sums(map)?
            .iter()
            .map(|color| color.count)
            .collect::<Vec<_>>())
    })?;
    array_of::<u32, Ix1>(py, &[counts.len()], &counts)
}

fn color_sums(map: MapContents) -> PyResult<Vec<ColorSum>> {
    let columns = MapColumns::from(map);
    columns
        .colors
        .ok_or_else(|| refuse("this map keeps no colours: maps made with colors=True do"))
}

/// Stamps of the first and the last point of each cell; NaT without one.
pub fn stamps<'py>(py: Python<'py>, list: &SharedList) -> PyResult<Bound<'py, PyAny>> {
    let stamps = of_map(py, list, |map| {
        let columns = MapColumns::from(map);
        let stamps = columns
            .stamps
            .ok_or_else(|| refuse("this map keeps no stamps: maps made with stamps=True do"))?;
        // NumPy's NaT is the smallest integer.
        let pair = |stamps: &Stamps| match *stamps == Stamps::NONE {
            true => [i64::MIN; 2],
            false => [stamps.first_ns, stamps.last_ns],
        };
        Ok(stamps.iter().map(pair).collect::<Vec<_>>())
    })?;
    let stamps = array_of::<i64, Ix2>(py, &[stamps.len(), 2], stamps.as_flattened())?;
    stamps.call_method1("view", ("datetime64[ns]",))
}

/// Voxels of a map without the statistics of its points.
pub fn rows(list: &SharedList) -> PyResult<MapColumns> {
    let mut columns = MapColumns::from(list.copied()?);
    columns.statistics = DistortionSums::default();
    Ok(columns)
}

fn of_map<T: Send + 'static>(
    py: Python<'_>,
    list: &SharedList,
    run: impl FnOnce(MapContents) -> PyResult<T> + Send + 'static,
) -> PyResult<T> {
    let list = list.clone();
    background(py, move |_| run(list.copied()?))?
}
