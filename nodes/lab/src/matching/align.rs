//! Climbing from a guess.

use super::{MAX_POINTS, MultiResolutionList, sample};
use crate::AnyError;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::voxels::{OccupancyList, VoxelStore};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Error for a map without voxels.
pub(super) const EMPTY_MAP: &str = "the map is empty";

/// Pose of a scan and its fit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Alignment {
    pub map_from_cloud: Isometry3<f64>,
    /// Number of points of the sample in occupied cells of the finest level.
    pub hits: usize,
    pub points: usize,
    pub evaluations: usize,
}

/// Step limits: per level, and of each final climb on the finest level; as in the original.
const LEVEL_STEPS: usize = 20;
const FINE_STEPS: usize = 100;
/// Number of final climbs, each with steps shorter by this factor; the original has one.
const FINE_STAGES: usize = 2;
const FINE_STEP: f64 = 0.25;
/// Rotation step on the finest level, degrees; it doubles from level to level.
const STEP_DEG: f64 = 0.5;

/// Aligns a scan with a map from a guess: climbs on every level, coarsest first, with steps of a cell size, then
/// refines on the finest level with fractions of them, on another sample of the scan.
///
/// Each level uses one point per cell of its own size, drawn from one per finest cell. A step goes along or about one
/// axis of the map. Rotations are about the centroid of those points, so that they do not translate the scan.
///
/// # Errors
/// For an empty map, a scan without points, and a guess that is not finite.
pub fn align(
    map: &MultiResolutionList,
    cloud: &Cloud,
    map_from_cloud: &Isometry3<f64>,
) -> Result<Alignment, AnyError> {
    let pose = begin(map, cloud, map_from_cloud)?;
    let finest = map.levels().first().ok_or(EMPTY_MAP)?;
    let all = sample_of(&cloud.offsets_m, finest.lattice(), MAX_POINTS, 0)?;
    let mut top = Top {
        pose,
        hits: 0,
        evaluations: 0,
    };
    for (level, list) in map.levels().iter().enumerate().rev() {
        let points = sample_of(&all, list.lattice(), MAX_POINTS, 0)?;
        let turn_deg = STEP_DEG * (1_u32 << level) as f64;
        top = climb(top, list, &points, (1.0, turn_deg, LEVEL_STEPS));
    }
    let points = sample_of(&cloud.offsets_m, finest.lattice(), MAX_POINTS, 1)?;
    let mut fraction = 1.0;
    for _ in 0..FINE_STAGES {
        fraction *= FINE_STEP;
        let steps = (fraction, fraction * STEP_DEG, FINE_STEPS);
        top = climb(top, finest, &points, steps);
    }
    Ok(Alignment {
        map_from_cloud: end(cloud, &top.pose),
        hits: top.hits,
        points: points.len(),
        evaluations: top.evaluations,
    })
}

/// Checks the input of a search, and returns the pose of the offsets of the cloud; its datum is then the origin.
pub(super) fn begin(
    map: &MultiResolutionList,
    cloud: &Cloud,
    map_from_cloud: &Isometry3<f64>,
) -> Result<Isometry3<f64>, AnyError> {
    if map.is_empty() {
        return Err(EMPTY_MAP.into());
    }
    if cloud.len() > MAX_POINTS {
        let points = cloud.len();
        return Err(format!("{points} points, at most {MAX_POINTS} are taken").into());
    }
    let pose = map_from_cloud * Translation3::from(cloud.datum_m);
    let finite = pose.to_homogeneous().iter().all(|entry| entry.is_finite());
    Ok(finite
        .then_some(pose)
        .ok_or("the pose to begin with is not finite")?)
}

pub(super) fn end(cloud: &Cloud, pose: &Isometry3<f64>) -> Isometry3<f64> {
    pose * Translation3::from(-cloud.datum_m)
}

/// A [`sample`] that fails if no point has a cell.
pub(super) fn sample_of(
    points_m: &[[f32; 3]],
    lattice: &Lattice,
    most: usize,
    round: u64,
) -> Result<Vec<[f32; 3]>, AnyError> {
    let points = sample(points_m, lattice, most, round);
    if points.is_empty() {
        let points = points_m.len();
        return Err(
            format!("none of {points} points is finite and near enough to its datum").into(),
        );
    }
    Ok(points)
}

struct Top {
    pose: Isometry3<f64>,
    hits: usize,
    evaluations: usize,
}

/// Climbs to the best of the twelve poses one step away as long as it is better; among equals, to the first. `(sides,
/// turn_deg, most)`: step length in cell sizes, rotation in degrees, step limit.
fn climb(
    top: Top,
    list: &OccupancyList,
    points_m: &[[f32; 3]],
    (sides, turn_deg, most): (f64, f64, usize),
) -> Top {
    let (metres, radians) = (sides * list.lattice().cell_side_m(), turn_deg.to_radians());
    let mut pose = top.pose;
    let about_m = middle_m(points_m);
    let mut hits = list.overlap(&pose, points_m);
    let mut evaluations = top.evaluations + 1;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for _ in 0..most {
        let mut best = None;
        for axis in axes {
            for sign in [-1.0, 1.0] {
                let shift = Vector3::from(axis * (sign * metres));
                let turn = Vector3::from(axis * (sign * radians));
                for (shift, turn) in [(shift, Vector3::zeros()), (Vector3::zeros(), turn)] {
                    let near = moved(&pose, &about_m, &shift, &turn);
                    let found = list.overlap(&near, points_m);
                    evaluations += 1;
                    if found > hits {
                        hits = found;
                        best = Some(near);
                    }
                }
            }
        }
        match best {
            Some(better) => pose = better,
            None => break,
        }
    }
    Top {
        pose,
        hits,
        evaluations,
    }
}

/// Mean of points, metres.
pub(super) fn middle_m(points_m: &[[f32; 3]]) -> Point3<f64> {
    let points = points_m.iter().map(|p| Vector3::from(p.map(f64::from)));
    let sum: Vector3<f64> = points.sum();
    (sum / points_m.len().max(1) as f64).into()
}

/// Pose translated along the axes of the map (metres) and rotated by a rotation vector (radians) about the
/// transformed position of a point (metres).
pub(super) fn moved(
    pose: &Isometry3<f64>,
    about_m: &Point3<f64>,
    shift_m: &Vector3<f64>,
    turn_rad: &Vector3<f64>,
) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_scaled_axis(*turn_rad) * pose.rotation;
    let before = pose.rotation * about_m.coords;
    let shift = shift_m + before - rotation * about_m.coords;
    let translation = Translation3::from(pose.translation.vector + shift);
    Isometry3::from_parts(translation, rotation)
}
