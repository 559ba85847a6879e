//! Nearest occupied cells of many points.

use std::sync::Arc;

use lattice_core::query::{Query, QueryError, Shells};
use nalgebra::Vector3;
use numpy::{Ix2, Ix3, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::empty;
use crate::errors::refuse;
use crate::points::{Points, Rows};
use crate::shared_list::SharedList;
use crate::threads::{on_pool, watched};

/// Points per task: close to each other in most clouds, as are the cells around them.
const PART: usize = 64;

/// Distances, shape (n, k), and centres, shape (n, k, 3), of the `k` cells nearest to each point; fewer if there are
/// fewer cells.
pub fn query<'py>(
    py: Python<'py>,
    shared: &SharedList,
    shells: Arc<Shells>,
    xyz: &Bound<'py, PyAny>,
    k: usize,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let points = Points::of(xyz)?;
    let rows = points.rows()?;
    let count = rows.len();
    let k = k.min(shared.read(py, |list| list.len())?);
    let distances = empty::<f64, Ix2>(py, &[count, k])?;
    let centers = empty::<f64, Ix3>(py, &[count, k, 3])?;
    if k > 0 {
        let mut to_distances = distances.try_readwrite().map_err(refuse)?;
        let mut to_centers = centers.try_readwrite().map_err(refuse)?;
        let to = to_distances.as_slice_mut().map_err(refuse)?;
        let centers = to_centers.as_slice_mut().map_err(refuse)?;
        let to = (to, centers.as_chunks_mut::<3>().0);
        let found = watched(py, |stop| {
            shared.read_away(|list| {
                let questions = shared.questions(list, shells, count.saturating_mul(k));
                on_pool(|| {
                    let parts = to.0.par_chunks_mut(PART * k);
                    let parts = parts.zip(to.1.par_chunks_mut(PART * k)).enumerate();
                    parts.try_for_each(|(number, (distances, centers))| {
                        let to = distances.chunks_mut(k).zip(centers.chunks_mut(k));
                        for (place, (distances, centers)) in to.enumerate() {
                            if stop.is_set() {
                                break;
                            }
                            let row = number * PART + place;
                            nearest(&questions, rows, row, distances, centers)?;
                        }
                        Ok(())
                    })
                })
            })
        })??;
        found.map_err(|(row, error): (usize, QueryError)| refuse(format!("row {row}: {error}")))?;
    }
    Ok((distances.into_any(), centers.into_any()))
}

/// Writes the cells nearest to a point; infinite and NaN if cells were removed meanwhile.
fn nearest(
    questions: &Query<lattice_core::voxels::VoxelList>,
    rows: Rows,
    row: usize,
    distances: &mut [f64],
    centers: &mut [[f64; 3]],
) -> Result<(), (usize, QueryError)> {
    let found = questions.nearest(&Vector3::from(rows.get(row)), distances.len());
    let mut found = found.map_err(|error| (row, error))?.into_iter();
    for (distance, center) in distances.iter_mut().zip(centers) {
        (*distance, *center) = match found.next() {
            Some(near) => (near.distance_m, near.center_m.into()),
            None => (f64::INFINITY, [f64::NAN; 3]),
        };
    }
    Ok(())
}
