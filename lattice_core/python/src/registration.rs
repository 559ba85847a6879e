//! `gicp`.

use lattice_core::registration::{
    MAX_NEIGHBORS, PrepareOptions, PreparedCloud, RegisterOptions, Registration as Found,
    SemanticCloud, register, voxel_downsample,
};
use nalgebra::{Matrix6, Point3};
use pyo3::prelude::*;

use crate::errors::refuse;
use crate::pickle::Reduced;
use crate::points::Points;
use crate::pose::{isometry_of, matrix_of, matrix6_of};
use crate::threads::{background, on_threads};

/// Maximum number of threads, above the cores of a machine.
const MAX_THREADS: i64 = 1024;
/// Maximum number of iterations, above any that converges.
const MAX_ITERATIONS: i64 = 1_000_000;

/// Result of a single registration.
#[pyclass(frozen, get_all, module = "lattice_core")]
pub struct Registration {
    /// Transform of source points to the target frame, shape (4, 4).
    target_from_source: Py<PyAny>,
    /// Covariance of x, y, z (m^2) and of the rotations about x, y, z (rad^2) in the target, shape (6, 6); NaN if the
    /// points do not determine the pose.
    ///
    /// For a source more than 100 m from its origin, x, y, z refer to its centroid.
    covariance: Py<PyAny>,
    /// Half the Hessian of the cost by a translation (m), then a rotation (rad) in the source, shape (6, 6), about
    /// the same point.
    hessian: Py<PyAny>,
    /// True if the last step was below the tolerances.
    converged: bool,
    /// Number of correspondence searches.
    iterations: usize,
    /// Number of source points with a correspondence.
    inliers: usize,
    /// RMS distance, m.
    rmse_m: f64,
}

#[pymethods]
impl Registration {
    fn __repr__(&self) -> String {
        let (converged, inliers, rmse_m) = (self.converged, self.inliers, self.rmse_m);
        format!("<Registration converged={converged} inliers={inliers} rmse_m={rmse_m:.4}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py> {
        let (py, own) = (slf.py(), slf.get());
        let arrays = [&own.target_from_source, &own.covariance, &own.hessian];
        let arrays = arrays.map(|array| array.clone_ref(py));
        let rest = (own.converged, own.iterations, own.inliers, own.rmse_m);
        let restore = slf.get_type().getattr("_restore")?;
        let arguments = (arrays, rest.0, rest.1, rest.2, rest.3);
        Ok((restore, arguments.into_pyobject(py)?))
    }

    #[staticmethod]
    fn _restore(
        arrays: [Py<PyAny>; 3],
        converged: bool,
        iterations: usize,
        inliers: usize,
        rmse_m: f64,
    ) -> Self {
        let [target_from_source, covariance, hessian] = arrays;
        Self {
            target_from_source,
            covariance,
            hessian,
            converged,
            iterations,
            inliers,
            rmse_m,
        }
    }
}

/// Registers `source` to `target` (points, m) by GICP from `init` (4 x 4); `cell` downsamples both first (m).
#[pyfunction]
#[pyo3(signature = (
    source, target, init=None, *, max_distance=1.0, cell=None, num_neighbors=10, num_threads=None, max_iterations=20
))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn gicp(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    init: Option<&Bound<'_, PyAny>>,
    max_distance: f64,
    cell: Option<f64>,
    num_neighbors: i64,
    num_threads: Option<i64>,
    max_iterations: i64,
) -> PyResult<Registration> {
    for (name, value) in [("max_distance", Some(max_distance)), ("cell", cell)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(refuse(format!(
                "{name} {value} m is not positive and finite"
            )));
        }
    }
    let neighbors = count("num_neighbors", num_neighbors, 3, MAX_NEIGHBORS as i64)?;
    let threads = num_threads.map(|threads| count("num_threads", threads, 1, MAX_THREADS));
    let threads = threads.transpose()?;
    let options = RegisterOptions {
        max_iterations: count("max_iterations", max_iterations, 1, MAX_ITERATIONS)?,
        ..RegisterOptions::gicp(max_distance)
    };
    let (source, target) = (cloud_of("source", source)?, cloud_of("target", target)?);
    let start = init.map(|init| isometry_of("init", init)).transpose()?;
    let start = start.unwrap_or_default();
    let prepare = move |cloud: SemanticCloud, name: &str| {
        let cloud = match cell {
            Some(side_m) => voxel_downsample(&cloud, side_m),
            None => cloud,
        };
        let options = PrepareOptions {
            neighbors,
            ..PrepareOptions::default()
        };
        let prepared = PreparedCloud::new(cloud, &options);
        prepared.map_err(|error| refuse(format!("{name}: {error}")))
    };
    let found = background(py, move |_| {
        on_threads(threads, || {
            let (source, target) = (prepare(source, "source")?, prepare(target, "target")?);
            Ok::<_, PyErr>(register(&source, &target, &start, &options))
        })?
    })??;
    Ok(Registration {
        target_from_source: matrix_of(py, &found.target_from_source)?,
        covariance: matrix6_of(py, &covariance(&found))?,
        hessian: matrix6_of(py, &found.hessian)?,
        converged: found.converged,
        iterations: found.iterations,
        inliers: found.inliers,
        rmse_m: found.rmse_m,
    })
}

/// Inverse of the Hessian times the variance of a correspondence, in the axes of the target.
///
/// A correspondence measures one distance, across its plane. Its variance is the cost per correspondence beyond the
/// six degrees of freedom of the pose.
fn covariance(found: &Found) -> Matrix6<f64> {
    let free = found.inliers.saturating_sub(6);
    let inverse = found.hessian.cholesky().map(|parts| parts.inverse());
    let Some(inverse) = inverse.filter(|_| free > 0) else {
        return Matrix6::repeat(f64::NAN);
    };
    let turn = found.target_from_source.rotation.to_rotation_matrix();
    let mut axes = Matrix6::zeros();
    axes.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
    axes.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
    axes * inverse * axes.transpose() * (found.cost / free as f64)
}

fn count(name: &str, value: i64, least: i64, most: i64) -> PyResult<usize> {
    let within = (least..=most).contains(&value);
    let value_in = usize::try_from(value).ok().filter(|_| within);
    value_in.ok_or_else(|| refuse(format!("{name} {value} is outside {least}..={most}")))
}

/// Converts points to a cloud; rejects rows that are not finite.
pub fn cloud_of(name: &str, xyz: &Bound<'_, PyAny>) -> PyResult<SemanticCloud> {
    let points = Points::of(xyz)?;
    let rows = points.rows()?;
    let all: Vec<Point3<f64>> = (0..rows.len()).map(|i| Point3::from(rows.get(i))).collect();
    if let Some(row) = all.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(refuse(format!(
            "{name}: row {row} is not finite: give xyz[np.isfinite(xyz).all(axis=1)]"
        )));
    }
    Ok(SemanticCloud::unlabelled(all))
}
