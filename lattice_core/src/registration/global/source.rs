//! Scans of a headset, checked and prepared.

use nalgebra::{Isometry3, Point3};

use super::super::{PrepareOptions, PreparedCloud, SemanticCloud, voxel_downsample};
use super::calibration::Refusal;
use super::request::{CalibrationOptions, CalibrationRequest};

/// Farthest that a point may be from the headset's origin, metres.
const MAX_RANGE_M: f64 = 10_000.0;

/// The headset's points at two densities.
pub(super) struct PreparedSource {
    /// The points that are registered.
    pub full: PreparedCloud,
    /// A coarse of them, for a first look.
    pub coarse: PreparedCloud,
    /// Place of the headset, if one is known.
    pub sensor_m: Option<Point3<f64>>,
}

impl PreparedSource {
    /// Checks the headset scans, puts them together and thins them to the spacing of the map.
    pub fn new(
        request: &CalibrationRequest<'_>,
        options: &CalibrationOptions,
        spacing_m: f64,
    ) -> Result<PreparedSource, Refusal> {
        let rejected = Refusal::Input;
        let n: usize = request.source_clouds.iter().map(|g| g.cloud.len()).sum();
        if n > options.max_points {
            let most = options.max_points;
            return Err(rejected(format!("{n} points, at most {most} are taken")));
        }
        let mut all = SemanticCloud::default();
        let labelled = (request.source_clouds.iter()).any(|g| !g.cloud.labels.is_empty());
        for source_cloud in request.source_clouds {
            if ![0, source_cloud.cloud.len()].contains(&source_cloud.cloud.labels.len()) {
                return Err(rejected("labels are not as many as points".into()));
            }
            for (i, point) in source_cloud.cloud.points_m.iter().enumerate() {
                // NaN fails this too.
                if point.iter().all(|c| c.abs() <= MAX_RANGE_M) {
                    all.points_m.push(*point);
                    if labelled {
                        all.labels.push(source_cloud.cloud.label(i));
                    }
                }
            }
        }
        if all.len() < options.min_points {
            let (got, least) = (all.len(), options.min_points);
            return Err(rejected(format!(
                "{got} usable points of {n}, at least {least} are needed"
            )));
        }
        if request.start.is_some_and(|start| !is_pose(&start)) {
            return Err(rejected("the start is not a pose".into()));
        }
        let full = thinned_to(&all, spacing_m, options.registered_points);
        let coarse = thinned_to(&full, 2.0 * spacing_m, options.registered_points / 8);
        let sensors: Vec<Point3<f64>> = request
            .source_clouds
            .iter()
            .filter_map(|g| g.sensor_m)
            .collect();
        let prepare = |cloud| {
            PreparedCloud::new(cloud, &PrepareOptions::default())
                .map_err(|e| rejected(format!("the points cannot be registered: {e}")))
        };
        let full = prepare(full)?;
        // Too far apart for normals of their own.
        let points_m = coarse.points_m.clone();
        let coarse = prepare(coarse)?.with_normals(|i| {
            let (nearest, _) = full.nearest(points_m.get(i)?, f64::MAX)?;
            full.normals().get(nearest).copied()
        });
        Ok(PreparedSource {
            full,
            coarse,
            sensor_m: match (sensors.as_slice(), request.source_clouds.len()) {
                ([sensor], 1) if sensor.iter().all(|c| c.abs() <= MAX_RANGE_M) => Some(*sensor),
                _ => None,
            },
        })
    }
}

/// Thins a cloud to cells of a side, or larger ones until coarse enough points are left.
fn thinned_to(cloud: &SemanticCloud, side_m: f64, most: usize) -> SemanticCloud {
    let mut side_m = side_m;
    loop {
        let thinned = voxel_downsample(cloud, side_m);
        if thinned.len() <= most.max(50) {
            return thinned;
        }
        // The number of cells of a surface goes with the square of their side.
        let factor = (thinned.len() as f64 / most.max(50) as f64).sqrt();
        side_m *= factor.clamp(1.1, 4.0);
    }
}

/// True if all numbers of a pose are finite and it turns without stretching.
pub(super) fn is_pose(pose: &Isometry3<f64>) -> bool {
    let near = pose.translation.vector.iter().all(|c| c.abs() <= 1e7);
    near && (pose.rotation.norm() - 1.0).abs() < 1e-3
}
