//! Inserting NumPy points into a map.

use lattice_core::voxels::{InsertReport, PointColumns};
use nalgebra::Vector3;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns::{
    StampColumn, colors as colors_of, kept, labels as labels_of, stamps as stamps_of,
};
use crate::errors::refuse;
use crate::points::{Points, Rows, mask_of, part, warn_of_rounding};
use crate::shared_list::SharedList;
use crate::threads::on_pool;

/// Points between two checks for signals, well below half a second.
const STEP: usize = 1 << 18;
/// The same with labels, stamps or colours, which one thread inserts.
const STEP_OF_COLUMNS: usize = 1 << 16;

/// Inserts points with their labels, stamps and colours; rows with a masked value are dropped and counted.
pub fn insert<'py>(
    py: Python<'py>,
    list: &SharedList,
    xyz: &Bound<'py, PyAny>,
    labels: Option<&Bound<'py, PyAny>>,
    stamps: Option<&Bound<'py, PyAny>>,
    colors: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (payload, side_m) = list.read(py, |list| (list.payload(), list.lattice().cell_side_m()))?;
    if labels.is_some() && !payload.labels {
        return Err(refuse("this map keeps no labels: make it with labels=True"));
    }
    if stamps.is_some() && !payload.stamps {
        return Err(refuse("this map keeps no stamps: make it with stamps=True"));
    }
    if stamps.is_none() && payload.stamps {
        return Err(refuse("this map keeps stamps: give stamps="));
    }
    if colors.is_some() && !payload.color {
        return Err(refuse(
            "this map keeps no colours: make it with colors=True",
        ));
    }
    let mut points = Points::unmasked(xyz)?;
    let count = points.rows()?.len();
    let mut label_column = match labels {
        Some(array) => labels_of(array, count)?,
        None => Vec::new(),
    };
    let mut color_column = match colors {
        Some(array) => colors_of(array, count)?,
        None => Vec::new(),
    };
    let mut stamp_column = match stamps {
        Some(array) => stamps_of(array, count)?,
        None => StampColumn::All(0),
    };
    if let Some(keep) = unmasked_rows(py, xyz, [labels, stamps])? {
        let flags: PyReadonlyArray1<bool> = keep.extract()?;
        let flags = flags.as_slice().map_err(refuse)?;
        let data = py.import("numpy")?.call_method1("asarray", (xyz,))?;
        points = Points::unmasked(&data.get_item(&keep)?)?;
        label_column = kept(&label_column, flags);
        color_column = kept(&color_column, flags);
        if let StampColumn::Each(stamps) = &mut stamp_column {
            *stamps = kept(stamps, flags);
        }
    }
    let rows = points.rows()?;
    warn_of_rounding(py, rows, side_m)?;
    let (stamp_ns, stamps_ns) = match &stamp_column {
        StampColumn::All(stamp_ns) => (*stamp_ns, &[][..]),
        StampColumn::Each(stamps_ns) => (0, stamps_ns.as_slice()),
    };
    let mut report = InsertReport::default();
    let step = match payload.is_plain() {
        true => STEP,
        false => STEP_OF_COLUMNS,
    };
    for start in (0..rows.len()).step_by(step) {
        let columns = PointColumns {
            stamp_ns,
            stamps_ns: part(stamps_ns, start, step),
            labels: part(&label_column, start, step),
            colors: part(&color_column, start, step),
        };
        let here = rows.part(start, step);
        let zero = Vector3::zeros();
        let more = list.write(py, |list| {
            on_pool(|| match here {
                Rows::F32(rows) => list.insert_points(zero, rows, columns),
                Rows::F64(rows) => list.insert_points(zero, rows, columns),
            })
        })??;
        add(&mut report, &more);
    }
    if report.out_of_range > 0 && report.out_of_range + report.not_finite == report.points {
        return Err(out_of_reach(py, list, rows)?);
    }
    let answer = PyDict::new(py);
    for (name, number) in [
        ("points", count as u64),
        ("inserted", report.inserted),
        ("masked", count as u64 - report.points),
        ("not_finite", report.not_finite),
        ("out_of_range", report.out_of_range),
        ("list_full", report.list_full),
        ("new_voxels", report.new_voxels),
    ] {
        answer.set_item(name, number)?;
    }
    Ok(answer)
}

/// Mask of the rows without masked values; `None` if nothing is masked.
fn unmasked_rows<'py>(
    py: Python<'py>,
    xyz: &Bound<'py, PyAny>,
    columns: [Option<&Bound<'py, PyAny>>; 2],
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let numpy = py.import("numpy")?;
    let mut masked = match mask_of(xyz)? {
        Some(mask) => Some(mask.call_method1("any", (1,))?),
        None => None,
    };
    for column in columns.into_iter().flatten() {
        let Some(mask) = mask_of(column)? else {
            continue;
        };
        if mask.getattr("ndim")?.extract::<usize>()? == 0 {
            return Err(refuse("the stamp of all points is masked"));
        }
        masked = Some(match masked {
            Some(masked) => numpy.call_method1("logical_or", (masked, mask))?,
            None => mask,
        });
    }
    masked
        .map(|masked| numpy.call_method1("logical_not", (masked,)))
        .transpose()
}

/// Error for points of which none is near the datum.
fn out_of_reach(py: Python<'_>, list: &SharedList, rows: Rows) -> PyResult<PyErr> {
    let datum: [f64; 3] = list.read(py, |list| list.datum_m().into())?;
    let mut finite = (0..rows.len()).map(|i| rows.get(i));
    let [x, y, z] = finite
        .find(|point| point.iter().all(|c| c.is_finite()))
        .unwrap_or_default();
    Ok(refuse(format!(
        "no point is within 2^20 cells of the datum {datum:?} m, the first is at ({x:.3}, {y:.3}, {z:.3}): make the map \
         with a datum near the points, VoxelMap(lattice, datum=({x:.0}, {y:.0}, {z:.0}))"
    )))
}

fn add(all: &mut InsertReport, more: &InsertReport) {
    all.points += more.points;
    all.inserted += more.inserted;
    all.not_finite += more.not_finite;
    all.out_of_range += more.out_of_range;
    all.list_full += more.list_full;
    all.new_voxels += more.new_voxels;
}
