//! Fit of a cloud at one pose, independent of the alternatives: its residuals by region and the unexplained regions.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::super::likelihood::region_of;
use super::candidates::RegistrationContext;
use super::diagnostics::LISTED;
pub use super::diagnostics::{FitDiagnostics, Unexplained, UnexplainedKind};
use super::rays::crossing_m;

/// Minimum number of points in a region that is tested.
const MIN_POINTS: usize = 8;
/// Shift of a region from the surfaces of the map that is significant, in standard deviations.
const SIGNIFICANT_SHIFT: f64 = 3.0;
/// Information of a region along a direction that constrains it, as a fraction of its points.
const MIN_INFORMATION: f64 = 0.1;
/// Fraction of the points of a region above which a property of points holds for the region.
const MAJORITY: f64 = 0.5;
/// Distance from a point to a different surface, in cells.
const CLEAR: f64 = 5.0;
/// Length of the ray behind a point that is searched for a surface, metres.
const BEHIND_M: f64 = 10.0;

/// Sums over the points of a region.
#[derive(Default)]
struct Region {
    points: usize,
    sum_m: Vector3<f64>,
    /// Inliers, and the normal equations of a shift over them.
    near: usize,
    normals: Matrix3<f64>,
    residual_m: Vector3<f64>,
    /// Traced lines of sight; of these, the ones ending in free space and the ones passing through a surface.
    traced: usize,
    floating: usize,
    hidden: usize,
}

/// Shift of a region along a constrained direction.
#[derive(Clone, Copy)]
struct Shift {
    meters: f64,
    sigmas: f64,
}

/// Computes the fit of the source at a pose.
pub(super) fn fit_diagnostics(
    context: &RegistrationContext<'_>,
    pose: &Isometry3<f64>,
) -> FitDiagnostics {
    let regions = regions(context, pose);
    let scale = context.map.scale(context.options.noise_m);
    let sigmas_m = (context.options.noise_m, scale.normal_m);
    let (mut chi_square, mut held) = (0.0, 0_u32);
    let mut unexplained = Vec::new();
    for region in regions.values().filter(|r| r.points >= MIN_POINTS) {
        let shifts = region.shifts(sigmas_m);
        chi_square += shifts.iter().map(|s| s.sigmas.powi(2)).sum::<f64>();
        held += shifts.len() as u32;
        unexplained.extend(region.unexplained(&shifts));
    }
    unexplained.sort_by_key(|region| std::cmp::Reverse(region.points));
    unexplained.truncate(LISTED);
    let sum = |of: fn(&Region) -> usize| regions.values().map(of).sum::<usize>() as f64;
    let traced = sum(|r| r.traced).max(1.0);
    FitDiagnostics {
        chi_square: chi_square / f64::from(held.max(1)),
        floating: sum(|r| r.floating) / traced,
        blocked: sum(|r| r.hidden) / traced,
        unexplained,
    }
}

/// Sums over the regions of correlated errors, in the order of their keys.
fn regions(context: &RegistrationContext<'_>, pose: &Isometry3<f64>) -> BTreeMap<[i64; 3], Region> {
    let (map, side_m) = (&context.map.cloud, context.options.region_m);
    let gate_m = context.map.scale(context.options.noise_m).gate_m();
    let mut regions: BTreeMap<[i64; 3], Region> = BTreeMap::new();
    for point in context.source.full.points_m() {
        let place = pose * point;
        let region = regions.entry(region_of(point, side_m)).or_default();
        region.points += 1;
        region.sum_m += place.coords;
        let near = map.nearest(&place, gate_m);
        let near = near.and_then(|(j, _)| map.points_m().get(j).zip(map.normals().get(j)));
        if let Some((q, n)) = near {
            region.near += 1;
            region.normals += n * n.transpose();
            region.residual_m += n * n.dot(&(place - q));
        }
    }
    let Some(sensor_m) = context.source.sensor_m else {
        return regions;
    };
    let (from, occupied) = (pose * sensor_m, &context.map.occupied);
    let clear_m = CLEAR * context.map.spacing_m;
    for point in context.source.coarse.points_m() {
        let region = regions.entry(region_of(point, side_m)).or_default();
        let place = pose * point;
        let length = nalgebra::distance(&from, &place);
        if length < 3.0 * clear_m {
            continue;
        }
        let direction = (place - from) / length;
        let crosses = |way| crossing_m(occupied, &from, &direction, way).is_some();
        region.traced += 1;
        if crosses(clear_m..length - clear_m) {
            region.hidden += 1;
        } else if map.nearest(&place, clear_m).is_none()
            && crosses(length + clear_m..length + BEHIND_M)
        {
            region.floating += 1;
        }
    }
    regions
}

impl Region {
    /// Shifts against the map along the constrained directions, given the standard deviations of a region's position
    /// and of a point, metres.
    fn shifts(&self, (of_region_m, of_point_m): (f64, f64)) -> Vec<Shift> {
        let eigen = self.normals.symmetric_eigen();
        let directions = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        let held = directions.filter(|(held, _)| **held > MIN_INFORMATION * self.points as f64);
        let shift = |(held, axis): (&f64, _)| {
            let meters = self.residual_m.dot(&axis) / held;
            let sigma_m = of_region_m.hypot(of_point_m / held.sqrt());
            Shift {
                meters: meters.abs(),
                sigmas: meters.abs() / sigma_m,
            }
        };
        held.map(shift).collect()
    }

    /// Misfit of the region, if there is one.
    fn unexplained(&self, shifts: &[Shift]) -> Option<Unexplained> {
        let most = |n: usize, of: usize| n as f64 > MAJORITY * of as f64;
        let beside = shifts.iter().filter(|s| s.sigmas > SIGNIFICANT_SHIFT);
        let beside_m = beside.map(|s| s.meters).reduce(f64::max);
        let kind = if most(self.hidden, self.traced) {
            UnexplainedKind::Hidden
        } else if !most(self.near, self.points) {
            match most(2 * self.floating, self.traced) {
                true => UnexplainedKind::Floating,
                false => UnexplainedKind::Missing,
            }
        } else if beside_m.is_some() {
            UnexplainedKind::Beside
        } else {
            return None;
        };
        Some(Unexplained {
            kind,
            place_m: (self.sum_m / self.points.max(1) as f64).into(),
            points: self.points,
            beside_m: match kind {
                UnexplainedKind::Beside => beside_m.unwrap_or_default(),
                _ => 0.0,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A region of `n` points of a wall, `near` of them within reach of it and `off_m` beside it.
    fn region(n: usize, near: usize, off_m: f64) -> Region {
        let normal = Vector3::x();
        Region {
            points: n,
            sum_m: Vector3::new(2.0, 1.0, 0.5) * n as f64,
            near,
            normals: normal * normal.transpose() * near as f64,
            residual_m: normal * off_m * near as f64,
            traced: n,
            ..Region::default()
        }
    }

    fn kind(region: &Region) -> Option<UnexplainedKind> {
        let shifts = region.shifts((0.02, 0.02));
        region.unexplained(&shifts).map(|found| found.kind)
    }

    #[test]
    fn a_region_is_unexplained_for_what_is_wrong_with_it() {
        assert_eq!(kind(&region(40, 40, 0.01)), None);
        assert_eq!(kind(&region(40, 40, -0.1)), Some(UnexplainedKind::Beside));
        assert_eq!(kind(&region(40, 10, 0.0)), Some(UnexplainedKind::Missing));
        let floating = Region {
            floating: 30,
            ..region(40, 10, 0.0)
        };
        assert_eq!(kind(&floating), Some(UnexplainedKind::Floating));
        let hidden = Region {
            hidden: 30,
            ..region(40, 40, 0.0)
        };
        assert_eq!(kind(&hidden), Some(UnexplainedKind::Hidden));
        let beside = region(40, 40, -0.1);
        let found = beside.unexplained(&beside.shifts((0.02, 0.02))).unwrap();
        assert!((found.beside_m - 0.1).abs() < 1e-9 && found.points == 40);
        assert!((found.place_m - Point3::new(2.0, 1.0, 0.5)).norm() < 1e-9);
    }

    #[test]
    fn a_wall_holds_a_region_across_it_only() {
        let shifts = region(100, 100, 0.04).shifts((0.02, 0.02));
        assert_eq!(shifts.len(), 1);
        // A region errs by 2 cm as a whole, however many points it has.
        assert!((shifts[0].sigmas - 2.0).abs() < 0.02);
    }
}
