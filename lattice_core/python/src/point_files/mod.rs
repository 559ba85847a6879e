//! Point files of Open3D, PCL and others: reading and writing PLY and PCD.

mod lzf;
mod pcd;
mod ply;
mod record;

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

use lattice_core::registration::UNLABELED;
use numpy::{Ix1, Ix2};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

use crate::arrays::array_of;
use crate::columns::labels as labels_of;
use crate::errors::{of_path, refuse};
use crate::map_files::{Stoppable, replace};
use crate::points::{Points, mask_of};
use crate::threads::background;

/// Coordinate below which PCD is written in single precision, exact to 0.25 mm, m: many readers assume single
/// precision.
const SINGLE_M: f64 = 4096.0;

/// Points of a file.
struct PointFile {
    /// Coordinates of each point, m.
    xyz: Vec<f64>,
    /// Label of each point, -1 for none, if the file has labels.
    labels: Option<Vec<i32>>,
    /// Warning about a part of the file that is not applied.
    warning: Option<String>,
}

/// Reads the points (m) of a `.ply` or `.pcd` file, float64 of shape (n, 3), and their labels, int32 of shape (n,),
/// -1 for none; None without a field `label`.
#[pyfunction]
pub fn read_points<'py>(
    py: Python<'py>,
    path: PathBuf,
) -> PyResult<(Bound<'py, PyAny>, Option<Bound<'py, PyAny>>)> {
    let of_work = path.clone();
    let file = background(py, move |_| {
        let bytes = fs::read(&of_work).map_err(|error| of_path(&of_work, &error))?;
        let read = match bytes.get(..4) {
            Some(b"ply\n" | b"ply\r") => ply::read(&bytes),
            _ if bytes.starts_with(b"#") || bytes.starts_with(b"VERSION") => pcd::read(&bytes),
            _ => Err("neither PLY, which begins with ply, nor PCD".to_owned()),
        };
        read.map_err(|reason| refuse(format!("{}: {reason}", of_work.display())))
    })??;
    if let Some(warning) = file.warning {
        let warning = std::ffi::CString::new(format!("{}: {warning}", path.display()))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &warning, 1)?;
    }
    let points = file.xyz.len() / 3;
    let xyz = array_of::<f64, Ix2>(py, &[points, 3], &file.xyz)?;
    let labels = file.labels;
    let labels = labels.map(|labels| array_of::<i32, Ix1>(py, &[labels.len()], &labels));
    Ok((xyz, labels.transpose()?))
}

/// Writes points (m), with one label per point if given (-1 for none), to a binary `.ply` or `.pcd` file, by its
/// name.
#[pyfunction]
#[pyo3(signature = (path, xyz, labels=None))]
pub fn write_points(
    py: Python<'_>,
    path: PathBuf,
    xyz: &Bound<'_, PyAny>,
    labels: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let points = Points::of(xyz)?;
    let rows = points.rows()?;
    let single = matches!(points, Points::F32(_));
    let points: Vec<[f64; 3]> = (0..rows.len()).map(|row| rows.get(row)).collect();
    let labels = match labels {
        Some(labels) => {
            if mask_of(labels)?.is_some() {
                return Err(refuse("labels are masked: give -1 for none"));
            }
            Some(labels_of(labels, points.len())?)
        }
        None => None,
    };
    let near = |point: &[f64; 3]| !point.iter().any(|c| c.is_finite() && c.abs() >= SINGLE_M);
    let (header, single) = match path.extension().and_then(|kind| kind.to_str()) {
        Some("ply") => (ply::header(points.len(), single, labels.is_some()), single),
        Some("pcd") => {
            let single = single || points.iter().all(near);
            (pcd::header(points.len(), single, labels.is_some()), single)
        }
        _ => {
            return Err(refuse(format!(
                "{}: the name of a file of points ends in .ply or .pcd",
                path.display()
            )));
        }
    };
    background(py, move |stop| {
        replace(
            &path,
            |file| {
                write(
                    Stoppable { file, stop },
                    &header,
                    &points,
                    single,
                    labels.as_deref(),
                )
                .map_err(|error| of_path(&path, &error))
            },
            stop,
        )
    })?
}

fn write(
    writer: impl Write,
    header: &str,
    points: &[[f64; 3]],
    single: bool,
    labels: Option<&[u16]>,
) -> io::Result<()> {
    let mut writer = io::BufWriter::new(writer);
    writer.write_all(header.as_bytes())?;
    for (row, point) in points.iter().enumerate() {
        for coordinate in point {
            match single {
                true => writer.write_all(&(*coordinate as f32).to_le_bytes())?,
                false => writer.write_all(&coordinate.to_le_bytes())?,
            }
        }
        if let Some(label) = labels.and_then(|labels| labels.get(row)) {
            writer.write_all(&label.to_le_bytes())?;
        }
    }
    writer.flush()
}

impl PointFile {
    fn new(has_labels: bool) -> PointFile {
        PointFile {
            xyz: Vec::new(),
            labels: has_labels.then(Vec::new),
            warning: None,
        }
    }

    /// Adds a point; labels -1 and 65535 mean none.
    fn push(&mut self, point_m: [f64; 3], label: Option<f64>, row: usize) -> Result<(), String> {
        self.xyz.extend(point_m);
        if let (Some(labels), Some(label)) = (&mut self.labels, label) {
            if label.fract() != 0.0 || !(-1.0..=f64::from(UNLABELED)).contains(&label) {
                return Err(format!(
                    "row {row}: label {label} is no integer from -1 to 65535"
                ));
            }
            let none = label == f64::from(UNLABELED);
            labels.push(if none { -1 } else { label as i32 });
        }
        Ok(())
    }
}

/// Lines of a header up to the one that `ends` it, and the remaining data.
fn header_of(bytes: &[u8], ends: impl Fn(&str) -> bool) -> Result<(Vec<&str>, &[u8]), String> {
    /// Maximum size of a header, bytes.
    const MOST: usize = 1 << 16;
    let (mut lines, mut rest) = (Vec::new(), bytes);
    loop {
        let Some(end) = rest.iter().take(MOST).position(|byte| *byte == b'\n') else {
            return Err("the header does not end".to_owned());
        };
        let (line, after) = rest.split_at(end);
        let line = std::str::from_utf8(line).map_err(|_| {
            let number = lines.len() + 1;
            format!("line {number} of the header is no text")
        })?;
        rest = after.get(1..).unwrap_or_default();
        lines.push(line.trim());
        if ends(line.trim()) {
            return Ok((lines, rest));
        }
        if bytes.len() - rest.len() > MOST {
            return Err(format!("the header is longer than {MOST} bytes"));
        }
    }
}
