//! Registration of a scan with the map: Gauss-Newton on SE(3), from points to planes or points.

use nalgebra::{
    Cholesky, Isometry3, Matrix3, Matrix6, Point3, SymmetricEigen, UnitQuaternion, Vector3, Vector6,
};
use rayon::prelude::*;

use super::moment_map::MomentMap;
use super::verdict::WeakDirection;

/// Number of points per task. Sums of tasks are added in order, so results do not depend on threads.
const CHUNK: usize = 256;
const MAX_ITERATIONS: usize = 30;
/// Step sizes below which the iterations end.
const DONE_M: f64 = 1e-3;
const DONE_RAD: f64 = 1e-4;
/// Number of neighbouring points with summed costs: they lie in one cell.
const GROUP: usize = 8;
/// Scale of the Geman-McClure kernel on the Mahalanobis distance.
const KERNEL: f64 = 3.0;

/// Normal equations of a perturbation (translation, rotation) in the axes of the map about the base.
#[derive(Clone, Debug)]
struct Equations {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    geometry: Geometry,
    weight: f64,
}

/// Observability of motions (translation, rotation about the base, axes of the map): sums over points on planes.
#[derive(Clone, Debug)]
pub(super) struct Geometry {
    /// Squared displacement along normals, minus the contribution of the uncertainty of the normals.
    observed: Matrix6<f64>,
    /// Squared displacement.
    displaced: Matrix6<f64>,
}

impl Equations {
    fn zero() -> Equations {
        Equations {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            geometry: Geometry {
                observed: Matrix6::zeros(),
                displaced: Matrix6::zeros(),
            },
            weight: 0.0,
        }
    }

    fn plus(mut self, other: &Equations) -> Equations {
        self.information += other.information;
        self.gradient += other.gradient;
        self.geometry.observed += other.geometry.observed;
        self.geometry.displaced += other.geometry.displaced;
        self.weight += other.weight;
        self
    }
}

/// Registered scan.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub map_from_base: Isometry3<f64>,
    /// Information of a perturbation (translation, rotation) about the base, in the axes of the map, m and rad.
    pub information: Matrix6<f64>,
    pub geometry: Geometry,
    /// Inlier fraction of the points.
    pub overlap: f64,
}

/// Registers points (base frame, metres) to the map from a guess; the pose stays as in the guess along the motions
/// `held`.
pub(super) fn align(
    map: &MomentMap,
    points_m: &[Vector3<f64>],
    guess: &Isometry3<f64>,
    gate_m: f64,
    held: &Held,
) -> Alignment {
    let mut pose = *guess;
    let free = held.free();
    for _ in 0..MAX_ITERATIONS {
        let equations = linearize(map, points_m, &pose, gate_m);
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
    let end = linearize(map, points_m, &pose, gate_m);
    let count = points_m.len().max(1) as f64;
    Alignment {
        map_from_base: pose,
        information: end.information,
        geometry: end.geometry,
        overlap: end.weight / count,
    }
}

/// Contrast of a motion: standard deviations by which the planes of the map explain points (base frame, metres)
/// better at a pose than at the pose moved by the motion, and by its opposite. The smaller of both is returned.
///
/// Only points that lie on planes at both poses are compared. If the map does not constrain the motion, differences
/// of the costs are negative as often as positive. Their spread is therefore estimated from the negative ones.
pub(super) fn contrast(
    map: &MomentMap,
    points_m: &[Vector3<f64>],
    pose: &Isometry3<f64>,
    motion: &Vector6<f64>,
    gate_m: f64,
) -> f64 {
    let moved = [perturbed(pose, motion), perturbed(pose, &-motion)];
    let cost = |pose: &Isometry3<f64>, point: &Vector3<f64>| {
        plane_cost(map, &(pose * Point3::from(*point)).coords, gate_m)
    };
    let groups: Vec<[f64; 2]> = points_m
        .par_chunks(GROUP)
        .map(|points| {
            let mut worse = [0.0; 2];
            for point in points {
                let Some(here) = cost(pose, point) else {
                    continue;
                };
                for (worse, other) in worse.iter_mut().zip(&moved) {
                    *worse += cost(other, point).map_or(0.0, |there| there - here);
                }
            }
            worse
        })
        .collect();
    let deviations = [0, 1].map(|side| {
        let worse = groups.iter().map(|group| group[side]);
        let sum: f64 = worse.clone().sum();
        let negative: f64 = worse.map(|worse| worse.min(0.0).powi(2)).sum();
        // One more for a scan without negative ones.
        sum / (1.0 + 2.0 * negative).sqrt()
    });
    deviations[0].min(deviations[1])
}

/// Robust cost of a point by its distance from the plane of its cell; `None` without a plane.
fn plane_cost(map: &MomentMap, moved: &Vector3<f64>, gate_m: f64) -> Option<f64> {
    let surface = map.nearest(moved, gate_m)?;
    let plane = surface.plane.as_ref()?;
    let off = moved - surface.mean_m;
    let variance_m2 = plane.across_m2 + off.dot(&(plane.tilt * off));
    let square = plane.normal.dot(&off).powi(2) / variance_m2;
    Some(KERNEL * KERNEL * square / (KERNEL * KERNEL + square))
}

/// Pose perturbed by (translation, rotation) in the axes of the map about the base.
pub(super) fn perturbed(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    Isometry3::from_parts(
        (pose.translation.vector + step.fixed_rows::<3>(0)).into(),
        UnitQuaternion::new_normalize((turn * pose.rotation).into_inner()),
    )
}

fn solve(equations: &Equations, free: &Matrix6<f64>) -> Option<Vector6<f64>> {
    let information = free.transpose() * equations.information * free;
    // Regular along what is held, where the gradient is 0.
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
) -> Equations {
    let parts: Vec<Equations> = points_m
        .par_chunks(CHUNK)
        .map(|points| {
            let mut sums = Equations::zero();
            for point in points {
                add_point(&mut sums, map, point, pose, gate_m);
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
    sums.information += sandwiched(&surface.information, &cross) * weight;
    let mut gradient = sums.gradient.fixed_rows_mut::<3>(0);
    gradient += pull * weight;
    let mut gradient = sums.gradient.fixed_rows_mut::<3>(3);
    gradient += arm.cross(&pull) * weight;
    sums.weight += weight;
    if let Some(plane) = &surface.plane {
        // The columns of [I, -arm x] along the normal, and its uncertainty.
        let turn = arm.cross(&plane.normal);
        let (n, r) = (plane.normal, turn);
        let row = Vector6::new(n.x, n.y, n.z, r.x, r.y, r.z);
        let spread = sandwiched(&plane.tilt, &cross);
        sums.geometry.observed += (row * row.transpose() - spread) * weight;
        sums.geometry.displaced += sandwiched(&Matrix3::identity(), &cross) * weight;
    }
}

/// `Jᵀ M J` with `J = [I, -arm x]`.
fn sandwiched(m: &Matrix3<f64>, cross: &Matrix3<f64>) -> Matrix6<f64> {
    let turned = cross * m;
    let mut all = Matrix6::zeros();
    let mut put = |row: usize, column: usize, block: &Matrix3<f64>| {
        all.fixed_view_mut::<3, 3>(row, column).copy_from(block);
    };
    put(0, 0, m);
    put(3, 0, &turned);
    put(0, 3, &turned.transpose());
    put(3, 3, &(turned * cross.transpose()));
    all
}

/// Motions along which a solution stays at the guess.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    motions: Vec<Vector6<f64>>,
    displaced: Matrix6<f64>,
}

impl Held {
    /// Projector onto the motions whose displacements are perpendicular to the held ones.
    fn free(&self) -> Matrix6<f64> {
        let held = self
            .motions
            .iter()
            .map(|m| m * (m.transpose() * self.displaced));
        held.fold(Matrix6::identity(), |free, part| free - part)
    }
}

impl Geometry {
    /// Six independent motions with their observed fractions, weakest first.
    ///
    /// Eigenvectors of `observed` relative to `displaced`.
    pub fn directions(&self) -> Vec<WeakDirection> {
        let unit = self.displaced / (self.displaced.trace() / 6.0).max(f64::MIN_POSITIVE);
        let Some(factor) = Cholesky::new(unit).and(Cholesky::new(self.displaced)) else {
            let all = (0..6).map(|i| WeakDirection {
                motion: Vector6::from_fn(|row, _| f64::from(u8::from(row == i))),
                part: 0.0,
            });
            return all.collect();
        };
        let lower = factor.l();
        let Some(inverse) = lower.try_inverse() else {
            return Vec::new();
        };
        let eigen = SymmetricEigen::new(inverse * self.observed * inverse.transpose());
        let mut directions: Vec<WeakDirection> = (0..6)
            .map(|i| WeakDirection {
                motion: inverse.transpose() * eigen.eigenvectors.column(i),
                part: eigen.eigenvalues[i],
            })
            .collect();
        directions.sort_by(|a, b| a.part.total_cmp(&b.part));
        directions
    }

    /// Factor that scales a motion of [`Geometry::directions`] to an RMS displacement of 1 m.
    pub fn per_meter(&self) -> f64 {
        self.displaced[(0, 0)].max(0.0).sqrt()
    }

    /// Fixes the directions that are weak here.
    pub fn hold(&self, weak: &[WeakDirection]) -> Held {
        Held {
            motions: weak.iter().map(|weak| weak.motion).collect(),
            displaced: self.displaced,
        }
    }
}
