//! `calibrate`.

use lattice_core::registration::{
    CalibrationMap, CalibrationRequest, LabelDistribution, Profile, SemanticCloud, SourceCloud,
    register_global,
};
use nalgebra::Point3;
use pyo3::prelude::*;

use crate::columns::labels as labels_of;
use crate::errors::refuse;
use crate::map::VoxelMap;
use crate::pickle::Reduced;
use crate::points::mask_of;
use crate::pose::{isometry_of, matrix_of, matrix6_of};
use crate::registration::cloud_of;
use crate::threads::{background, on_pool};

/// Pose of a cloud in a map, with its verdict.
#[pyclass(frozen, get_all, module = "lattice_core")]
pub struct Calibration {
    /// OK, AMBIGUOUS, DEGENERATE, NO_OVERLAP or REJECTED_INPUT; use the pose only with OK.
    verdict: String,
    /// Reason for the verdict.
    reason: String,
    /// Transform of points of the cloud to the map, shape (4, 4).
    map_from_cloud: Py<PyAny>,
    /// Covariance of x, y, z (m^2) and of the rotations about x, y, z (rad^2) in the map, shape (6, 6).
    covariance: Py<PyAny>,
    /// Probability of error, p_wrong.
    p_wrong: f64,
    /// Fraction of inliers.
    inlier_fraction: f64,
    /// RMS distance of the inliers from the surfaces, m.
    rmse_m: f64,
    /// Method that found the pose.
    method: String,
}

#[pymethods]
impl Calibration {
    fn __repr__(&self) -> String {
        let (verdict, p_wrong, reason) = (&self.verdict, self.p_wrong, &self.reason);
        format!("<Calibration {verdict} p_wrong={p_wrong:.2e}: {reason}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py> {
        let (py, own) = (slf.py(), slf.get());
        let texts = [&own.verdict, &own.reason, &own.method].map(String::clone);
        let arrays = [&own.map_from_cloud, &own.covariance].map(|array| array.clone_ref(py));
        let numbers = [own.p_wrong, own.inlier_fraction, own.rmse_m];
        let restore = slf.get_type().getattr("_restore")?;
        Ok((restore, (texts, arrays, numbers).into_pyobject(py)?))
    }

    #[staticmethod]
    fn _restore(texts: [String; 3], arrays: [Py<PyAny>; 2], numbers: [f64; 3]) -> Self {
        let [verdict, reason, method] = texts;
        let [map_from_cloud, covariance] = arrays;
        let [p_wrong, inlier_fraction, rmse_m] = numbers;
        Self {
            verdict,
            reason,
            map_from_cloud,
            covariance,
            p_wrong,
            inlier_fraction,
            rmse_m,
            method,
        }
    }
}

/// Registers a cloud (points, m, gravity along -z) in a map without an initial guess, with a verdict.
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
    let profile = *known.ok_or_else(|| {
        let names = Profile::ALL.map(Profile::name);
        refuse(format!("profile {profile:?} is none of {names:?}"))
    })?;
    let mut cloud = cloud_of("xyz", xyz)?;
    if let Some(labels) = labels {
        if mask_of(labels)?.is_some() {
            return Err(refuse("labels are masked: give the points that have one"));
        }
        let labels = labels_of(labels, cloud.len())?;
        cloud.labels = labels.into_iter().map(LabelDistribution::hard).collect();
    }
    let start = start.map(|start| isometry_of("start", start)).transpose()?;
    let list = map.list.clone();
    let found = background(py, move |stop| {
        let (map, side_m) = list.read_away(|list| {
            let side_m = list.lattice().cell_side_m();
            (on_pool(|| SemanticCloud::from_voxels(list)), side_m)
        });
        let map = map?;
        on_pool(|| {
            let map = CalibrationMap::new(map, side_m);
            let map = map.map_err(|error| refuse(format!("map: {error}")))?;
            let scans = [SourceCloud {
                cloud,
                sensor_m: sensor.map(Point3::from),
            }];
            let request = CalibrationRequest {
                source_clouds: &scans,
                start,
                confusion: None,
            };
            Ok::<_, PyErr>(register_global(&map, &request, &profile.options(), stop))
        })?
    })??;
    Ok(Calibration {
        verdict: found.verdict.name().to_owned(),
        map_from_cloud: matrix_of(py, &found.target_from_source)?,
        covariance: matrix6_of(py, &found.covariance)?,
        p_wrong: found.margin.p_wrong(),
        inlier_fraction: found.inlier_fraction,
        rmse_m: found.rmse_m,
        method: found.method.to_owned(),
        reason: found.reason,
    })
}
