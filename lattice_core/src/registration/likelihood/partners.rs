//! Correspondences of source points in the target at a pose.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::super::Neighbors;
use super::Fit;

/// Correspondences per source point.
const NEIGHBORS: usize = 4;

/// Tested ratios of the deviation across surfaces to the expected one; each halves the variance.
pub(super) const CLOSENESS: [f64; 5] = [
    1.0,
    std::f64::consts::FRAC_1_SQRT_2,
    0.5,
    0.5 * std::f64::consts::FRAC_1_SQRT_2,
    0.25,
];

/// Correspondence of a source point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Partner {
    /// Index of the target point.
    pub target: u32,
    /// Likelihood from the distance along the surface and the normals, at most 1.
    pub beside: f64,
    /// Squared Mahalanobis distance across the surface.
    across: f64,
}

impl Partner {
    const NONE: Partner = Partner {
        target: 0,
        beside: 0.0,
        across: 0.0,
    };

    /// Adds the likelihood at each of the [`CLOSENESS`] values.
    pub fn add_to(&self, nearness: &mut [f64; CLOSENESS.len()]) {
        let mut across = (-0.5 * self.across).exp();
        for (sum, closeness) in nearness.iter_mut().zip(CLOSENESS) {
            *sum += self.beside / closeness * across;
            // Halving the variance squares the exponential.
            across *= across;
        }
    }

    /// Likelihood of the correspondence if the deviation across surfaces is `closeness` times the expected one; at
    /// most `1 / closeness`.
    pub fn nearness(&self, closeness: f64) -> f64 {
        if self.beside > 0.0 {
            self.beside / closeness * (-0.5 * self.across / (closeness * closeness)).exp()
        } else {
            0.0
        }
    }
}

/// Correspondences of all source points at a pose.
pub struct Partners {
    pub(super) of_point: Vec<[Partner; NEIGHBORS]>,
    /// RMS distance of inliers across the surfaces, metres.
    pub rmse_m: f64,
    /// Fraction of inliers.
    pub inlier_fraction: f64,
}

impl Fit<'_> {
    /// Finds the correspondences of all source points.
    pub fn partners(&self, target_from_source: &Isometry3<f64>) -> Partners {
        self.partners_at(&target_from_source.rotation, |p| target_from_source * p)
    }

    /// Finds the correspondences with the points scaled about a centre; regions and weights stay.
    pub fn partners_scaled(
        &self,
        target_from_source: &Isometry3<f64>,
        center: &Point3<f64>,
        scale: f64,
    ) -> Partners {
        let place = |p: &Point3<f64>| target_from_source * (center + scale * (p - center));
        self.partners_at(&target_from_source.rotation, place)
    }

    fn partners_at(
        &self,
        turn: &UnitQuaternion<f64>,
        place: impl Fn(&Point3<f64>) -> Point3<f64> + Sync,
    ) -> Partners {
        let points = self.source.points_m();
        let of_point: Vec<([Partner; NEIGHBORS], f64)> = points
            .par_iter()
            .enumerate()
            .with_min_len(256)
            .map_init(Neighbors::default, |near, (i, point)| {
                self.partners_of(i, &place(point), turn, near)
            })
            .collect();
        let (mut sum, mut n) = (0.0, 0.0);
        for (_, squared) in of_point.iter().filter(|p| p.1.is_finite()) {
            sum += squared;
            n += 1.0;
        }
        Partners {
            rmse_m: if n > 0.0 { f64::sqrt(sum / n) } else { 0.0 },
            inlier_fraction: n / points.len().max(1) as f64,
            of_point: of_point.into_iter().map(|p| p.0).collect(),
        }
    }

    /// Correspondences of a point at its place, and the squared distance across the nearest surface.
    fn partners_of(
        &self,
        i: usize,
        place: &Point3<f64>,
        turn: &UnitQuaternion<f64>,
        near: &mut Neighbors,
    ) -> ([Partner; NEIGHBORS], f64) {
        let normal = self
            .source
            .normals()
            .get(i)
            .copied()
            .unwrap_or_else(Vector3::zeros);
        let normal = turn * normal;
        let mut partners = [Partner::NONE; NEIGHBORS];
        let mut nearest = f64::INFINITY;
        let gate_m = self.scale.gate_m();
        self.target.nearest_k(place, NEIGHBORS, gate_m, near);
        for (slot, (j, _)) in partners.iter_mut().zip(near.iter()) {
            let (Some(q), Some(m)) = (self.target.points_m().get(j), self.target.normals().get(j))
            else {
                continue;
            };
            let r = place - q;
            let across = r.dot(m);
            let along_sq = (r.norm_squared() - across * across).max(0.0);
            let along = along_sq / self.scale.tangent_m.powi(2);
            let facing = 0.3 + 0.7 * normal.dot(m).powi(2);
            *slot = Partner {
                target: j as u32,
                beside: facing * (-0.5 * along).exp() / NEIGHBORS as f64,
                across: (across / self.scale.normal_m).powi(2),
            };
            if across.abs() < 3.0 * self.scale.normal_m {
                nearest = nearest.min(across * across);
            }
        }
        (partners, nearest)
    }
}
