//! Source clouds, checked and downsampled.

use nalgebra::{Isometry3, Point3};

use super::super::{PrepareOptions, PreparedCloud, SemanticCloud, voxel_downsample};
use super::calibration::Refusal;
use super::request::{CalibrationOptions, CalibrationRequest};

/// Maximum coordinate of a source point, metres.
const MAX_RANGE_M: f64 = 10_000.0;

/// Source points at two densities.
pub(super) struct PreparedSource {
    /// Registered points.
    pub full: PreparedCloud,
    /// Subset for the coarse refinement.
    pub coarse: PreparedCloud,
    /// Position of the sensor in the source frame, if there is one cloud and it is known.
    pub sensor_m: Option<Point3<f64>>,
}

impl PreparedSource {
    /// Checks and merges the source clouds, and downsamples them to the spacing of the map.
    pub fn new(
        request: &CalibrationRequest<'_>,
        options: &CalibrationOptions,
        spacing_m: f64,
    ) -> Result<PreparedSource, Refusal> {
        let rejected = Refusal::Input;
        let n: usize = request
            .source_clouds
            .iter()
            .map(|source| source.cloud.len())
            .sum();
        if n > options.max_points {
            let most = options.max_points;
            return Err(rejected(format!(
                "point count {n} is above {most} (`max_points`)"
            )));
        }
        let mut all = SemanticCloud::default();
        let labelled = (request.source_clouds.iter()).any(|source| !source.cloud.labels.is_empty());
        for source_cloud in request.source_clouds {
            let (labels, points) = (source_cloud.cloud.labels.len(), source_cloud.cloud.len());
            if ![0, points].contains(&labels) {
                return Err(rejected(format!(
                    "label count {labels} differs from point count {points}"
                )));
            }
            for (i, point) in source_cloud.cloud.points_m.iter().enumerate() {
                // NaN fails this comparison too.
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
                "{got} of {n} points are usable, below {least} (`min_points`): finite, within {MAX_RANGE_M} m"
            )));
        }
        if request.start.is_some_and(|start| !is_pose(&start)) {
            return Err(rejected(
                "the initial guess is not a pose: a number is not finite or too large".into(),
            ));
        }
        let full = downsample_to(&all, spacing_m, options.registered_points);
        let coarse = downsample_to(&full, 2.0 * spacing_m, options.registered_points / 8);
        let sensors: Vec<Point3<f64>> = request
            .source_clouds
            .iter()
            .filter_map(|source| source.sensor_m)
            .collect();
        let prepare = |cloud| {
            PreparedCloud::new(cloud, &PrepareOptions::default())
                .map_err(|e| rejected(format!("source cloud: {e}")))
        };
        let full = prepare(full)?;
        // The coarse points are too sparse for normals of their own.
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

/// Downsamples a cloud to cells of `side_m`, or larger ones until at most `most` points are left.
fn downsample_to(cloud: &SemanticCloud, side_m: f64, most: usize) -> SemanticCloud {
    let mut side_m = side_m;
    loop {
        let thinned = voxel_downsample(cloud, side_m);
        if thinned.len() <= most.max(50) {
            return thinned;
        }
        // The number of cells on a surface is inversely proportional to the square of their side.
        let factor = (thinned.len() as f64 / most.max(50) as f64).sqrt();
        side_m *= factor.clamp(1.1, 4.0);
    }
}

/// Tests whether a pose is finite, near the origin and a rigid motion.
pub(super) fn is_pose(pose: &Isometry3<f64>) -> bool {
    let near = pose.translation.vector.iter().all(|c| c.abs() <= 1e7);
    near && (pose.rotation.norm() - 1.0).abs() < 1e-3
}
