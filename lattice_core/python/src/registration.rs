//! `gicp` and `calibrate`.

use lattice_core::registration::{
    CalibrationMap, CalibrationRequest, HeadsetScan, LabelDistribution, PrepareOptions,
    PreparedCloud, Profile, RegisterOptions, SemanticCloud, calibrate as search, register,
    voxel_downsample,
};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::map::VoxelMap;
use crate::points::{Points, array_of, labels as labels_of};
use crate::refuse;

/// Result of a single registration.
#[pyclass(frozen, get_all, module = "lattice_core")]
pub struct Registration {
    /// Takes source points to the target frame, shape (4, 4).
    target_from_source: Py<PyAny>,
    /// True if the last step was below the tolerances.
    converged: bool,
    /// Searches for pairs.
    iterations: usize,
    /// Source points with a pair.
    inliers: usize,
    /// Root of the mean of the squared distances, m.
    rmse_m: f64,
}

/// Pose of a cloud in a map, and whether it can be trusted.
#[pyclass(frozen, get_all, module = "lattice_core")]
pub struct Calibration {
    /// OK, AMBIGUOUS, DEGENERATE, NO_OVERLAP or REJECTED_INPUT; the pose is to be used only with OK.
    verdict: &'static str,
    /// Reason for the verdict.
    reason: String,
    /// Takes points of the cloud to the map, shape (4, 4).
    map_from_cloud: Py<PyAny>,
    /// Covariance of x, y, z (m^2) and the turns about x, y, z (rad^2) in the map, shape (6, 6).
    covariance: Py<PyAny>,
    /// Probability that another pose is right.
    p_wrong: f64,
    /// Share of the points on a surface of the map.
    inlier_fraction: f64,
    /// Root mean square distance of those from the surfaces, m.
    rmse_m: f64,
    /// Method that made the winning pose.
    method: &'static str,
}

#[pymethods]
impl Registration {
    fn __repr__(&self) -> String {
        let (converged, inliers, rmse_m) = (self.converged, self.inliers, self.rmse_m);
        format!("<Registration converged={converged} inliers={inliers} rmse_m={rmse_m:.4}>")
    }
}

#[pymethods]
impl Calibration {
    fn __repr__(&self) -> String {
        let (verdict, p_wrong, reason) = (self.verdict, self.p_wrong, &self.reason);
        format!("<Calibration {verdict} p_wrong={p_wrong:.2e}: {reason}>")
    }
}

/// Registers `source` to `target` (points, m) by GICP from `init` (4 x 4); `cell` thins both first (m).
#[pyfunction]
#[pyo3(signature = (source, target, init=None, *, max_distance=1.0, cell=None))]
pub fn gicp(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    init: Option<&Bound<'_, PyAny>>,
    max_distance: f64,
    cell: Option<f64>,
) -> PyResult<Registration> {
    for (name, value) in [("max_distance", Some(max_distance)), ("cell", cell)] {
        if value.is_some_and(|v| !(v > 0.0 && v.is_finite())) {
            return Err(refuse(format!("{name} {value:?} is no length over 0")));
        }
    }
    let (source, target) = (cloud_of(source)?, cloud_of(target)?);
    let start = init.map(isometry_of).transpose()?.unwrap_or_default();
    let run = || {
        let prepare = |cloud: SemanticCloud, name: &str| {
            let cloud =
                cell.map_or_else(|| cloud.clone(), |side_m| voxel_downsample(&cloud, side_m));
            let prepared = PreparedCloud::new(cloud, &PrepareOptions::default());
            prepared.map_err(|error| format!("{name}: {error}"))
        };
        let (source, target) = (prepare(source, "source")?, prepare(target, "target")?);
        Ok::<_, String>(register(
            &source,
            &target,
            &start,
            &RegisterOptions::gicp(max_distance),
        ))
    };
    let found = py.detach(run).map_err(refuse)?;
    Ok(Registration {
        target_from_source: matrix_of(py, &found.target_from_source)?,
        converged: found.converged,
        iterations: found.iterations,
        inliers: found.inliers,
        rmse_m: found.rmse_m,
    })
}

/// Finds where a cloud (points, m, gravity along -z) lies in a map, without a guess, and judges the answer.
#[pyfunction]
#[pyo3(signature = (map, xyz, labels=None, *, sensor=None, start=None, profile="headset"))]
pub fn calibrate(
    py: Python<'_>,
    map: &VoxelMap,
    xyz: &Bound<'_, PyAny>,
    labels: Option<&Bound<'_, PyAny>>,
    sensor: Option<[f64; 3]>,
    start: Option<&Bound<'_, PyAny>>,
    profile: &str,
) -> PyResult<Calibration> {
    let known = Profile::ALL.iter().find(|known| known.name() == profile);
    let profile = known.ok_or_else(|| {
        let names = Profile::ALL.map(Profile::name);
        refuse(format!("profile {profile:?} is none of {names:?}"))
    })?;
    let mut cloud = cloud_of(xyz)?;
    if let Some(labels) = labels {
        let labels = labels_of(labels, cloud.len())?;
        cloud.labels = labels.into_iter().map(LabelDistribution::hard).collect();
    }
    let start = start.map(isometry_of).transpose()?;
    let run = || {
        let side_m = map.list.lattice().cell_side_m();
        let map = SemanticCloud::from_voxels(&map.list);
        let map = CalibrationMap::new(map, side_m).map_err(|error| format!("map: {error}"))?;
        let scans = [HeadsetScan {
            cloud,
            sensor_m: sensor.map(Point3::from),
        }];
        let request = CalibrationRequest {
            headset_scans: &scans,
            start,
            confusion: None,
        };
        Ok::<_, String>(search(&map, &request, &profile.options(), &()))
    };
    let found = py.detach(run).map_err(refuse)?;
    let row = |i: usize| [0, 1, 2, 3, 4, 5].map(|k: usize| found.covariance[(i, k)]);
    Ok(Calibration {
        verdict: found.verdict.name(),
        map_from_cloud: matrix_of(py, &found.map_from_headset)?,
        covariance: array_of(py, &[0, 1, 2, 3, 4, 5].map(row))?.unbind(),
        p_wrong: found.margin.p_wrong(),
        inlier_fraction: found.inlier_fraction,
        rmse_m: found.rmse_m,
        method: found.method,
        reason: found.reason,
    })
}

fn cloud_of(xyz: &Bound<'_, PyAny>) -> PyResult<SemanticCloud> {
    let points = Points::of(xyz)?;
    let rows = points.rows()?;
    let all = (0..rows.len()).map(|i| Point3::from(rows.get(i)));
    Ok(SemanticCloud::unlabelled(all.collect()))
}

/// A rigid transform as a matrix of shape (4, 4).
fn matrix_of(py: Python<'_>, pose: &Isometry3<f64>) -> PyResult<Py<PyAny>> {
    let m = pose.to_homogeneous();
    let row = |i: usize| [m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]];
    Ok(array_of(py, &[row(0), row(1), row(2), row(3)])?.unbind())
}

/// The rigid transform of a matrix of shape (4, 4); refuses one that is none.
fn isometry_of(matrix: &Bound<'_, PyAny>) -> PyResult<Isometry3<f64>> {
    let numpy = matrix.py().import("numpy")?;
    let matrix = numpy.call_method1("ascontiguousarray", (matrix, "float64"))?;
    let matrix: PyReadonlyArray2<f64> = matrix
        .extract()
        .map_err(|_| refuse("a pose is no (4, 4) matrix"))?;
    let rows = matrix.as_slice().map_err(refuse)?.as_chunks::<4>().0;
    let [a, b, c, last] = rows else {
        return Err(refuse("a pose is no (4, 4) matrix"));
    };
    let turn = Matrix3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]);
    let rigid = (turn * turn.transpose() - Matrix3::identity()).norm() < 1e-6
        && turn.determinant() > 0.0
        && *last == [0.0, 0.0, 0.0, 1.0];
    let place = Vector3::new(a[3], b[3], c[3]);
    if !rigid || !place.iter().all(|value| value.is_finite()) {
        return Err(refuse(format!("{rows:?} is no rigid transform")));
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Ok(Isometry3::from_parts(Translation3::from(place), turn))
}
