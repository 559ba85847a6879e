//! Likelihood of a pose given a source and a target, which ranks all candidates.

mod fit;
mod indistinct;
mod partners;

use super::PreparedCloud;
use super::confusion::{Confusion, Counts, Lift};
use partners::CLOSENESS;

pub(super) use fit::region_of;
pub use fit::{Fit, FitScale};
pub use indistinct::IndistinctDifference;
pub(super) use indistinct::quantile;
pub use partners::Partners;

/// Prior fraction of inliers.
const INLIERS: f64 = 0.8;
/// Ratio of the density of inliers on a surface to that of outliers.
const CONTRAST: f64 = 25.0;
/// Cross-validation folds of the label co-occurrence.
const FOLDS: usize = 5;
/// Maximum number of independent points per region.
const INDEPENDENT: f64 = 4.0;

/// Log-likelihood of a pose relative to that of random points.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Likelihood {
    /// Part of the surfaces.
    pub surfaces: f64,
    /// Part of the labels, cross-validated between folds.
    pub labels: f64,
}

impl Likelihood {
    /// Total log-likelihood.
    pub fn total(&self) -> f64 {
        self.surfaces + self.labels
    }
}

impl<'a> Fit<'a> {
    /// Divides a source into regions.
    pub fn new(source: &'a PreparedCloud, target: &'a PreparedCloud, scale: FitScale) -> Fit<'a> {
        let regions: Vec<[i64; 3]> = (source.points_m().iter())
            .map(|point| region_of(point, scale.region_m))
            .collect();
        let mut sizes = rustc_hash::FxHashMap::default();
        for region in &regions {
            *sizes.entry(*region).or_insert(0.0) += 1.0;
        }
        let weight = |region: &[i64; 3]| {
            let size: f64 = sizes.get(region).copied().unwrap_or(1.0);
            size.min(INDEPENDENT) / size
        };
        let fold = |region: &[i64; 3]| {
            let [x, y, z] = region.map(|c| c as u64);
            let mixed = x.wrapping_mul(0x9e37_79b9_7f4a_7c15)
                ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
                ^ z.wrapping_mul(0x1656_67b1_9e37_79f9);
            (mixed.wrapping_mul(0xff51_afd7_ed55_8ccd) >> 40) as usize % FOLDS
        };
        Fit {
            source,
            target,
            scale,
            weights: regions.iter().map(weight).collect(),
            folds: regions.iter().map(|r| fold(r) as u8).collect(),
        }
    }

    /// Model without some points, by the index of each point.
    pub fn without(&self, is_left_out: &[bool]) -> Fit<'a> {
        let mut weights = self.weights.clone();
        for (weight, _) in weights
            .iter_mut()
            .zip(is_left_out)
            .filter(|(_, left_out)| **left_out)
        {
            *weight = 0.0;
        }
        Fit {
            weights,
            folds: self.folds.clone(),
            ..*self
        }
    }

    /// Effective number of independent observations in the source.
    pub fn observations(&self) -> f64 {
        self.weights.iter().sum()
    }

    /// Log-likelihood of a pose at which all points are outliers.
    pub fn outlier_log_likelihood(&self) -> f64 {
        self.observations() * log_density(0.0)
    }

    /// Log-likelihood of a pose with given correspondences, and the label co-occurrence learned at it.
    ///
    /// The deviation across surfaces is estimated at the pose, up to the expected one: a pose with smaller residuals
    /// is more likely. Labels contribute as far as `known` and the co-occurrence in the other folds predict them;
    /// `agreement` is as in [`Confusion::lift`].
    pub fn likelihood(
        &self,
        partners: &Partners,
        known: &Confusion,
        agreement: f64,
    ) -> (Likelihood, Confusion) {
        let (surfaces, closeness) = self.closest(partners);
        let counts = self.count(partners, closeness);
        let lifts = lifts(&counts, known, agreement);
        let points = 0..partners.of_point.len();
        let both = || -> f64 {
            points
                .map(|i| self.of_point(i, partners, closeness, &lifts))
                .sum()
        };
        let labels = match counts.is_empty() {
            true => 0.0,
            false => both() - surfaces,
        };
        let likelihood = Likelihood { surfaces, labels };
        (likelihood, sum(counts.iter()))
    }

    /// Log-likelihood of one point.
    fn of_point(&self, i: usize, partners: &Partners, closeness: f64, lifts: &[Lift]) -> f64 {
        let Some(near) = partners.of_point.get(i) else {
            return 0.0;
        };
        let label = self.source.label(i);
        let lift = (self.folds.get(i)).and_then(|&fold| lifts.get(usize::from(fold)));
        let mut labelled = 0.0;
        for partner in near.iter().filter(|p| p.beside > 0.0) {
            labelled += partner.nearness(closeness)
                * lift.map_or(1.0, |lift| {
                    lift.expected(&label, &self.target.label(partner.target as usize))
                });
        }
        self.weight(i) * log_density(labelled)
    }

    /// Largest log-likelihood by surfaces over the [`CLOSENESS`] values, with that value; the first of equal ones.
    fn closest(&self, partners: &Partners) -> (f64, f64) {
        let parts = self.by_surfaces(partners).into_iter().zip(CLOSENESS);
        let better = |a: (f64, f64), b: (f64, f64)| if b.0 > a.0 { b } else { a };
        parts.fold((f64::NEG_INFINITY, 1.0), better)
    }

    /// Weight of a source point.
    pub fn weight(&self, i: usize) -> f64 {
        self.weights.get(i).copied().unwrap_or(0.0)
    }

    /// Log-likelihood by surfaces at each of the [`CLOSENESS`] values.
    fn by_surfaces(&self, partners: &Partners) -> [f64; CLOSENESS.len()] {
        let outlier = log_density(0.0);
        let mut sums = [0.0; CLOSENESS.len()];
        for (near, weight) in partners.of_point.iter().zip(&self.weights) {
            let mut nearness = [0.0; CLOSENESS.len()];
            let near = near.iter().filter(|p| p.beside > 0.0);
            near.for_each(|partner| partner.add_to(&mut nearness));
            // Without a correspondence all are 0 and need no logarithm.
            let [widest, ..] = nearness;
            let density = |n: f64| {
                if widest > 0.0 {
                    log_density(n)
                } else {
                    outlier
                }
            };
            for (sum, nearness) in sums.iter_mut().zip(nearness) {
                *sum += weight * density(nearness);
            }
        }
        sums
    }

    /// Label co-occurrence counts by fold; empty if a cloud is unlabelled.
    fn count(&self, partners: &Partners, closeness: f64) -> Vec<Counts> {
        if !self.source.is_labelled() || !self.target.is_labelled() {
            return Vec::new();
        }
        let mut counts = vec![Counts::default(); FOLDS];
        for (i, near) in partners.of_point.iter().enumerate() {
            let fold = self.folds.get(i).copied().unwrap_or(0);
            let label = self.source.label(i);
            let sum: f64 = near.iter().map(|p| p.nearness(closeness)).sum();
            // Posterior probability that the source point is an inlier.
            let share = INLIERS * CONTRAST / (1.0 - INLIERS + INLIERS * CONTRAST * sum);
            for partner in near.iter().filter(|p| p.beside > 0.0) {
                let target = self.target.label(partner.target as usize);
                if let Some(counts) = counts.get_mut(usize::from(fold)) {
                    let nearness = partner.nearness(closeness);
                    counts.add(&label, &target, self.weight(i) * share * nearness);
                }
            }
        }
        counts
    }
}

/// Lift for each fold, from the prior and the other folds.
fn lifts(counts: &[Counts], known: &Confusion, agreement: f64) -> Vec<Lift> {
    let lift = |fold: usize| {
        let others = counts.iter().enumerate().filter(|(i, _)| *i != fold);
        let others = sum(others.map(|(_, counts)| counts));
        known.merged(&others).lift(agreement)
    };
    (0..counts.len()).map(lift).collect()
}

/// Merges counts.
fn sum<'a>(counts: impl Iterator<Item = &'a Counts>) -> Confusion {
    let mut all = Counts::default();
    counts.for_each(|counts| all.add_all(counts));
    all.confusion()
}

/// Log-density of the mixture of inliers and outliers.
fn log_density(nearness: f64) -> f64 {
    (1.0 - INLIERS + INLIERS * CONTRAST * nearness).ln()
}
