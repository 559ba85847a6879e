//! Rigid transforms as matrices of shape (4, 4).

use nalgebra::{Isometry3, Matrix3, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector3};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::arrays::rows_of;
use crate::errors::refuse;
use crate::points::shape_of;

/// Maximum distance (Frobenius norm) of a matrix from the nearest rotation: that of nine numbers rounded to four
/// decimals.
const MAX_FROM_ROTATION: f64 = 3.0 * 0.5e-4;

/// Converts a rigid transform to a matrix of shape (4, 4).
pub fn matrix_of(py: Python<'_>, pose: &Isometry3<f64>) -> PyResult<Py<PyAny>> {
    let m = pose.to_homogeneous();
    let row = |i: usize| [m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]];
    Ok(rows_of(py, &[row(0), row(1), row(2), row(3)])?.unbind())
}

/// Converts to a matrix of shape (6, 6).
pub fn matrix6_of(py: Python<'_>, m: &Matrix6<f64>) -> PyResult<Py<PyAny>> {
    let row = |i: usize| [0, 1, 2, 3, 4, 5].map(|k: usize| m[(i, k)]);
    Ok(rows_of(py, &[0, 1, 2, 3, 4, 5].map(row))?.unbind())
}

/// Rigid transform of the argument `name`; its rotation is the one nearest to the matrix.
pub fn isometry_of(name: &str, matrix: &Bound<'_, PyAny>) -> PyResult<Isometry3<f64>> {
    let numpy = matrix.py().import("numpy")?;
    let matrix = numpy.call_method1("asarray", (matrix,))?;
    let shape = shape_of(&matrix)?;
    if shape != [4, 4] {
        return Err(refuse(format!("{name} has shape {shape:?}, not (4, 4)")));
    }
    let matrix = numpy.call_method1("require", (matrix, "float64", ["C", "A"]))?;
    let matrix: PyReadonlyArray2<f64> = matrix.extract()?;
    let rows = matrix.as_slice().map_err(refuse)?.as_chunks::<4>().0;
    let [a, b, c, last] = rows else {
        return Err(refuse(format!("{name} is not a (4, 4) matrix")));
    };
    let near = Matrix3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]);
    let place = Vector3::new(a[3], b[3], c[3]);
    if !rows.as_flattened().iter().all(|value| value.is_finite()) {
        return Err(refuse(format!("{name} is not finite: {rows:?}")));
    }
    if *last != [0.0, 0.0, 0.0, 1.0] {
        return Err(refuse(format!(
            "{name} is not a rigid transform: its last row is {last:?}, not [0, 0, 0, 1]"
        )));
    }
    let svd = near.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Err(refuse(format!("{name} is not a rigid transform: {rows:?}")));
    };
    let turn = u * v_t;
    let off = (turn - near).norm();
    if off > MAX_FROM_ROTATION || turn.determinant() < 0.0 {
        let determinant = near.determinant();
        return Err(refuse(format!(
            "{name} is no rigid transform: its matrix is {off:.2e} from the nearest rotation, at most \
             {MAX_FROM_ROTATION:.1e} are taken, and its determinant is {determinant:.6}"
        )));
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Ok(Isometry3::from_parts(Translation3::from(place), turn))
}
