//! Registration of a scan with the map: Gauss-Newton on SE(3), from points to planes or points.

use nalgebra::{Cholesky, Isometry3, Matrix6, SymmetricEigen, UnitQuaternion, Vector3, Vector6};
use rayon::prelude::*;

use super::moment_map::MomentMap;

/// Points of one task; sums of tasks are added in order, so that threads change no bit.
const CHUNK: usize = 256;
const MAX_ITERATIONS: usize = 30;
/// Steps below these end the iterations.
const DONE_M: f64 = 1e-3;
const DONE_RAD: f64 = 1e-4;
/// Scale of the Geman-McClure kernel on the Mahalanobis distance.
const KERNEL: f64 = 3.0;

/// Normal equations of a perturbation (translation, rotation) in the axes of the map about the base.
#[derive(Clone, Debug)]
struct Equations {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    /// Normals of planes with their lever arms, less what their uncertainty adds: information by direction.
    geometry: Matrix6<f64>,
    weight: f64,
    matched: usize,
}

impl Equations {
    fn zero() -> Equations {
        Equations {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            geometry: Matrix6::zeros(),
            weight: 0.0,
            matched: 0,
        }
    }

    fn plus(mut self, other: &Equations) -> Equations {
        self.information += other.information;
        self.gradient += other.gradient;
        self.geometry += other.geometry;
        self.weight += other.weight;
        self.matched += other.matched;
        self
    }
}

/// A scan in the map.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub map_from_base: Isometry3<f64>,
    /// Of a perturbation (translation, rotation) in the axes of the map about the base, m and rad.
    pub information: Matrix6<f64>,
    /// Part of the points whose planes hold each direction, as a matrix; rotations in units of `arm_m`.
    pub geometry: Matrix6<f64>,
    /// Part of the points that the map explains.
    pub overlap: f64,
}

/// Directions that a solution leaves at the guess: an orthonormal basis, rotations in units of `arm_m`.
pub(super) type Held = Vec<Vector6<f64>>;

/// Moves points (base frame, metres) onto the map from a guess; `held` directions stay at the guess.
pub(super) fn align(
    map: &MomentMap,
    points_m: &[Vector3<f64>],
    guess: &Isometry3<f64>,
    gate_m: f64,
    arm_m: f64,
    held: &Held,
) -> Alignment {
    let mut pose = *guess;
    let free = free_part(held, arm_m);
    for _ in 0..MAX_ITERATIONS {
        let equations = linearize(map, points_m, &pose, gate_m, arm_m);
        let Some(step) = solve(&equations, &free) else {
            break;
        };
        pose = perturbed(&pose, &step);
        let (moved, turned) = (
            step.fixed_rows::<3>(0).norm(),
            step.fixed_rows::<3>(3).norm(),
        );
        if moved < DONE_M && turned < DONE_RAD {
            break;
        }
    }
    let end = linearize(map, points_m, &pose, gate_m, arm_m);
    let count = points_m.len().max(1) as f64;
    Alignment {
        map_from_base: pose,
        information: end.information,
        geometry: end.geometry / count,
        overlap: end.weight / count,
    }
}

/// A pose moved by (translation, rotation) in the axes of the map about the base.
pub(super) fn perturbed(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    Isometry3::from_parts(
        (pose.translation.vector + step.fixed_rows::<3>(0)).into(),
        UnitQuaternion::new_normalize((turn * pose.rotation).into_inner()),
    )
}

/// Projector onto the directions that are not held, in metres and radians.
fn free_part(held: &Held, arm_m: f64) -> Matrix6<f64> {
    let scale = scales(arm_m);
    let held = held.iter().map(|v| v * v.transpose());
    let free = held.fold(Matrix6::identity(), |free, part| free - part);
    // Scaled coordinates are (translation, arm * rotation).
    Matrix6::from_diagonal(&scale.map(|s| 1.0 / s)) * free * Matrix6::from_diagonal(&scale)
}

fn scales(arm_m: f64) -> Vector6<f64> {
    Vector6::new(1.0, 1.0, 1.0, arm_m, arm_m, arm_m)
}

fn solve(equations: &Equations, free: &Matrix6<f64>) -> Option<Vector6<f64>> {
    let information = free.transpose() * equations.information * free;
    // Held directions get the information of a point, so that the matrix is regular; their gradient is 0.
    let damping = 1e-9 * information.trace().max(1e-9);
    let information = information + Matrix6::identity() * damping;
    let step = Cholesky::new(information)?.solve(&(-free.transpose() * equations.gradient));
    let step = free * step;
    step.iter().all(|x| x.is_finite()).then_some(step)
}

fn linearize(
    map: &MomentMap,
    points_m: &[Vector3<f64>],
    pose: &Isometry3<f64>,
    gate_m: f64,
    arm_m: f64,
) -> Equations {
    let parts: Vec<Equations> = points_m
        .par_chunks(CHUNK)
        .map(|points| {
            let mut sums = Equations::zero();
            for point in points {
                add_point(&mut sums, map, point, pose, gate_m, arm_m);
            }
            sums
        })
        .collect();
    parts.iter().fold(Equations::zero(), Equations::plus)
}

fn add_point(
    sums: &mut Equations,
    map: &MomentMap,
    point: &Vector3<f64>,
    pose: &Isometry3<f64>,
    gate_m: f64,
    arm_m: f64,
) {
    let arm = pose.rotation * point;
    let moved = arm + pose.translation.vector;
    let Some(surface) = map.nearest(&moved, gate_m) else {
        return;
    };
    let residual = moved - surface.mean_m;
    let pull = surface.information * residual;
    let ratio = KERNEL * KERNEL / (KERNEL * KERNEL + residual.dot(&pull));
    let weight = ratio * ratio;
    // The Jacobian is [I, -arm x].
    let cross = arm.cross_matrix();
    let rotated = cross * surface.information;
    let mut add = |row: usize, column: usize, block: &nalgebra::Matrix3<f64>| {
        let mut part = sums.information.fixed_view_mut::<3, 3>(row, column);
        part += block * weight;
    };
    add(0, 0, &surface.information);
    add(3, 0, &rotated);
    add(0, 3, &rotated.transpose());
    add(3, 3, &(rotated * cross.transpose()));
    let mut gradient = sums.gradient.fixed_rows_mut::<3>(0);
    gradient += pull * weight;
    let mut gradient = sums.gradient.fixed_rows_mut::<3>(3);
    gradient += arm.cross(&pull) * weight;
    sums.weight += weight;
    sums.matched += 1;
    if let Some(plane) = &surface.plane {
        let lever = arm / arm_m;
        let turn = lever.cross(&plane.normal);
        let mut row = Vector6::zeros();
        row.fixed_rows_mut::<3>(0).copy_from(&plane.normal);
        row.fixed_rows_mut::<3>(3).copy_from(&turn);
        let cross = lever.cross_matrix();
        let mut spread = Matrix6::zeros();
        let tilted = cross * plane.tilt;
        spread.fixed_view_mut::<3, 3>(0, 0).copy_from(&plane.tilt);
        spread.fixed_view_mut::<3, 3>(3, 0).copy_from(&tilted);
        spread
            .fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&tilted.transpose());
        spread
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(tilted * cross.transpose()));
        sums.geometry += (row * row.transpose() - spread) * weight;
    }
}

/// Directions in which fewer than `least` of the points hold the scan, weakest first, each with its part.
pub(super) fn weak_directions(geometry: &Matrix6<f64>, least: f64) -> Vec<(f64, Vector6<f64>)> {
    let eigen = SymmetricEigen::new(*geometry);
    let mut weak: Vec<(f64, Vector6<f64>)> = (0..6)
        .map(|i| {
            (
                eigen.eigenvalues[i],
                eigen.eigenvectors.column(i).into_owned(),
            )
        })
        .filter(|(part, _)| *part < least)
        .collect();
    weak.sort_by(|a, b| a.0.total_cmp(&b.0));
    weak
}
