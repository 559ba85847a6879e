//! Likelihood of a pose given a source and a target, by which all candidates are judged.

mod chance;
mod partners;

use nalgebra::Point3;

use super::PreparedCloud;
use super::confusion::{Confusion, Counts, Lift};
use partners::CLOSENESS;

pub use chance::Even;
pub(super) use chance::quantile;
pub use partners::Partners;

/// Share of source points that have a partner in the target.
const INLIERS: f64 = 0.8;
/// Density of points on a surface of the map over that anywhere else.
const CONTRAST: f64 = 25.0;
/// Parts of the source that labels are judged by while they are learned from the others.
const FOLDS: usize = 5;
/// Points of a region that count as independent, at most.
const INDEPENDENT: f64 = 4.0;

/// Deviations within which points are expected to agree.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FitScale {
    /// Standard deviation across a surface, metres.
    pub normal_m: f64,
    /// Standard deviation along a surface, metres: about the spacing of the map's points.
    pub tangent_m: f64,
    /// Side of the regions that count as one observation each, metres.
    pub region_m: f64,
}

impl FitScale {
    /// For a map whose points are about `spacing_m` apart and clouds with `noise_m` of their own.
    pub fn new(spacing_m: f64, noise_m: f64) -> FitScale {
        FitScale {
            normal_m: (0.25 * spacing_m).hypot(noise_m),
            tangent_m: spacing_m.hypot(noise_m),
            region_m: 8.0 * spacing_m,
        }
    }

    /// The same for points that are refined only roughly.
    pub fn coarser(self, factor: f64) -> FitScale {
        FitScale {
            normal_m: self.normal_m * factor,
            tangent_m: self.tangent_m * factor,
            ..self
        }
    }

    /// Farthest that a partner may be, metres.
    pub fn gate_m(&self) -> f64 {
        3.0 * self.tangent_m.max(self.normal_m)
    }
}

/// The source, cut into regions, ready to be judged at many poses.
pub struct Fit<'a> {
    source: &'a PreparedCloud,
    target: &'a PreparedCloud,
    scale: FitScale,
    /// Weight of each source point; points of a crowded region share what it counts.
    weights: Vec<f64>,
    folds: Vec<u8>,
}

/// Log-likelihood of a pose; each observation adds 0 where it lies on the map as often as by chance.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Likelihood {
    /// By the surfaces alone.
    pub surfaces: f64,
    /// Part of the labels, each judged by what the others taught.
    pub labels: f64,
}

impl Likelihood {
    /// Log-likelihood by surfaces and labels.
    pub fn total(&self) -> f64 {
        self.surfaces + self.labels
    }
}

impl<'a> Fit<'a> {
    /// Cuts a source into regions, to be judged in a target.
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

    /// Independent observations in the source.
    pub fn observations(&self) -> f64 {
        self.weights.iter().sum()
    }

    /// Log-likelihood of a pose that puts no point near the target.
    pub fn outlier_log_likelihood(&self) -> f64 {
        self.observations() * log_density(0.0)
    }

    /// Likelihood of a pose whose partners these are. How close surfaces are is learned from the pose, up
    /// to the expected closeness: one that fits better than it had to is the likelier. Labels count as far
    /// as `known` and what the other folds teach predict them; `agreement` as in [`Confusion::lift`]. With
    /// it comes what the pose teaches about the labels.
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

    /// Log-likelihood by surfaces at the closeness of surfaces that fits best, and that closeness; the
    /// widest of equal ones.
    fn closest(&self, partners: &Partners) -> (f64, f64) {
        let parts = self.by_surfaces(partners).into_iter().zip(CLOSENESS);
        let better = |a: (f64, f64), b: (f64, f64)| if b.0 > a.0 { b } else { a };
        parts.fold((f64::NEG_INFINITY, 1.0), better)
    }

    fn weight(&self, i: usize) -> f64 {
        self.weights.get(i).copied().unwrap_or(0.0)
    }

    /// Log-likelihood by surfaces at each of the [`CLOSENESS`].
    fn by_surfaces(&self, partners: &Partners) -> [f64; CLOSENESS.len()] {
        let outlier = log_density(0.0);
        let mut sums = [0.0; CLOSENESS.len()];
        for (near, weight) in partners.of_point.iter().zip(&self.weights) {
            let mut nearness = [0.0; CLOSENESS.len()];
            let near = near.iter().filter(|p| p.beside > 0.0);
            near.for_each(|partner| partner.add_to(&mut nearness));
            // Without a partner all are 0, and none needs a logarithm.
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

    /// Labels seen in one place, by fold; none where one cloud has none.
    fn count(&self, partners: &Partners, closeness: f64) -> Vec<Counts> {
        if !self.source.is_labelled() || !self.target.is_labelled() {
            return Vec::new();
        }
        let mut counts = vec![Counts::default(); FOLDS];
        for (i, near) in partners.of_point.iter().enumerate() {
            let fold = self.folds.get(i).copied().unwrap_or(0);
            let label = self.source.label(i);
            let sum: f64 = near.iter().map(|p| p.nearness(closeness)).sum();
            // Share of the source point that is on the map at all.
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

/// Region of a side that a point is in.
pub(super) fn region_of(point: &Point3<f64>, side_m: f64) -> [i64; 3] {
    [point.x, point.y, point.z].map(|c| (c / side_m).floor() as i64)
}

/// The lift to judge each fold by: what is known and what the others teach.
fn lifts(counts: &[Counts], known: &Confusion, agreement: f64) -> Vec<Lift> {
    let lift = |fold: usize| {
        let others = counts.iter().enumerate().filter(|(i, _)| *i != fold);
        let others = sum(others.map(|(_, counts)| counts));
        known.merged(&others).lift(agreement)
    };
    (0..counts.len()).map(lift).collect()
}

fn sum<'a>(counts: impl Iterator<Item = &'a Counts>) -> Confusion {
    let mut all = Counts::default();
    counts.for_each(|counts| all.add_all(counts));
    all.confusion()
}

/// Log of a mixture of partners and of a point anywhere.
fn log_density(nearness: f64) -> f64 {
    (1.0 - INLIERS + INLIERS * CONTRAST * nearness).ln()
}
