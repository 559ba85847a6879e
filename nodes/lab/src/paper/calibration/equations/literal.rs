//! The printed formulas, written out: what the library is compared with.

use lattice_core::pose::se3;
use lattice_core::registration::{Neighbors, PreparedCloud, RegisterOptions, register};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3, Vector6};

/// Scale of the Cauchy loss, as published.
pub(super) const ALPHA: f64 = 3.0;

/// rho_alpha(x) = alpha^2 log(1 + x / alpha^2).
pub(super) fn rho(x: f64, alpha: f64) -> f64 {
    alpha * alpha * (x / (alpha * alpha)).ln_1p()
}

/// Derivative of the kernel.
pub(super) fn rho_slope(x: f64, alpha: f64) -> f64 {
    1.0 / (1.0 + x / (alpha * alpha))
}

/// A source point and a target point.
pub(super) struct Pair {
    source_m: Point3<f64>,
    target_m: Point3<f64>,
    /// Sigma of the source and of the target, m^2.
    spreads_m2: [Matrix3<f64>; 2],
    weight: f64,
}

impl Pair {
    /// r = x^t - T(x^s).
    fn residual(&self, pose: &Isometry3<f64>) -> Vector3<f64> {
        self.target_m - pose * self.source_m
    }

    /// C = Sigma^t + R Sigma^s R^T.
    fn spread(&self, pose: &Isometry3<f64>) -> Matrix3<f64> {
        let r = pose.rotation.to_rotation_matrix().into_inner();
        let [source, target] = self.spreads_m2;
        target + r * source * r.transpose()
    }

    /// C^-1; 0 if there is none.
    fn information(&self, pose: &Isometry3<f64>) -> Matrix3<f64> {
        self.spread(pose).try_inverse().unwrap_or_default()
    }

    /// ||r||^2_C.
    pub fn squared(&self, pose: &Isometry3<f64>) -> f64 {
        let r = self.residual(pose);
        r.dot(&(self.information(pose) * r))
    }

    /// The density of r.
    fn density(&self, pose: &Isometry3<f64>) -> f64 {
        let spread = (std::f64::consts::TAU * self.spread(pose)).determinant();
        (-0.5 * self.squared(pose)).exp() / spread.sqrt()
    }
}

/// Each source point with its `k` nearest target points.
pub(super) fn nearest(
    source: &PreparedCloud,
    target: &PreparedCloud,
    pose: &Isometry3<f64>,
    k: usize,
    gate_m: f64,
) -> Vec<Pair> {
    let flat = 1.0 - target.plane_epsilon();
    let spread = |n: &Vector3<f64>| Matrix3::identity() - flat * n * n.transpose();
    let mut found = Neighbors::default();
    let mut pairs = Vec::new();
    let sources = source.points_m().iter().zip(source.covariances_m2());
    for (i, (source_m, spread_m2)) in sources.enumerate() {
        target.nearest_k(&(pose * source_m), k, gate_m, &mut found);
        for (j, _) in found.iter() {
            let target_of = target.points_m().get(j).zip(target.normals().get(j));
            let Some((target_m, normal)) = target_of else {
                continue;
            };
            let tops = (source.label(i).top(), target.label(j).top());
            pairs.push(Pair {
                source_m: *source_m,
                target_m: *target_m,
                spreads_m2: [spread_m2, spread(normal)],
                // One-hot labels: sum over s of p(s | x^t) p(s | x^s).
                weight: f64::from(u8::from(tops.0.is_some() && tops.0 == tops.1)),
            });
        }
    }
    pairs
}

/// The same pairs, each with a weight of 1.
pub(super) fn alike(pairs: Vec<Pair>) -> Vec<Pair> {
    let alike = |pair| Pair {
        weight: 1.0,
        ..pair
    };
    pairs.into_iter().map(alike).collect()
}

/// Eq. (3): the sum of rho over pairs.
pub(super) fn gicp(pairs: &[Pair], pose: &Isometry3<f64>) -> f64 {
    pairs.iter().map(|p| rho(p.squared(pose), ALPHA)).sum()
}

/// Eq. (7) with the weight before the loss.
pub(super) fn outside(pairs: &[Pair], pose: &Isometry3<f64>) -> f64 {
    let cost = |p: &Pair| p.weight * rho(p.squared(pose), ALPHA);
    pairs.iter().map(cost).sum()
}

/// Eqs. (5) and (7) as printed: the weight, with the density at the old pose, within the loss.
pub(super) fn inside(pairs: &[Pair], old: &Isometry3<f64>, pose: &Isometry3<f64>) -> f64 {
    let cost = |p: &Pair| rho(p.weight * p.density(old) * p.squared(pose), ALPHA);
    pairs.iter().map(cost).sum()
}

/// Gradient of [`outside`] by the right perturbation (rho, phi) of the pose: -2 u and
/// -2 (x^s + Sigma^s u) x u of each pair, where u = R^T C^-1 r.
pub(super) fn gradient(pairs: &[Pair], pose: &Isometry3<f64>) -> Vector6<f64> {
    let mut sum = Vector6::zeros();
    for pair in pairs {
        let u = pose.rotation.inverse() * (pair.information(pose) * pair.residual(pose));
        let slope = pair.weight * rho_slope(pair.squared(pose), ALPHA);
        let arm = pair.source_m.coords + pair.spreads_m2[0] * u;
        let turn = arm.cross(&u);
        sum -= 2.0 * slope * Vector6::new(u.x, u.y, u.z, turn.x, turn.y, turn.z);
    }
    sum
}

/// The same by central differences, extrapolated once.
pub(super) fn numeric_gradient(pairs: &[Pair], pose: &Isometry3<f64>) -> Vector6<f64> {
    let slope = |axis: usize, h: f64| {
        let at = |by: f64| {
            let mut step = Vector6::zeros();
            step[axis] = by;
            outside(pairs, &(pose * se3::exp(&step)))
        };
        (at(h) - at(-h)) / (2.0 * h)
    };
    Vector6::from_fn(|axis, _| (4.0 * slope(axis, 5e-5) - slope(axis, 1e-4)) / 3.0)
}

/// Cost of a pose by the library.
pub(super) fn of_library(
    source: &PreparedCloud,
    target: &PreparedCloud,
    pose: &Isometry3<f64>,
    options: &RegisterOptions,
) -> f64 {
    let once = RegisterOptions {
        max_iterations: 1,
        inner_iterations: 1,
        ..*options
    };
    register(source, target, pose, &once).cost
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_is_flat_far_away_and_its_slope_the_numeric_one() {
        for x in [0.0, 0.1, 1.0, 9.0, 1e3] {
            let h = 1e-4 * (1.0 + x);
            let numeric = (rho(x + h, ALPHA) - rho(x - h, ALPHA)) / (2.0 * h);
            assert!((rho_slope(x, ALPHA) - numeric).abs() < 1e-7, "{x}");
        }
        assert_eq!(rho_slope(9.0, ALPHA), 0.5);
    }

    #[test]
    fn the_density_of_nothing_off_is_that_of_the_spread() {
        let pair = Pair {
            source_m: Point3::origin(),
            target_m: Point3::origin(),
            spreads_m2: [Matrix3::identity() * 0.5; 2],
            weight: 1.0,
        };
        // (2 pi)^-3/2 for a unit spread.
        let density = pair.density(&Isometry3::identity());
        assert!((density - 0.063_493_635_934).abs() < 1e-9);
    }
}
