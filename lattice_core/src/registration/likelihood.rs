//! Likelihood of a pose given a source and a target, by which all candidates are judged.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::confusion::{Confusion, Counts, Lift};
use super::{Neighbors, PreparedCloud};

/// Share of source points that have a partner in the target.
const INLIERS: f64 = 0.8;
/// Density of points on a surface of the map over that anywhere else.
const CONTRAST: f64 = 25.0;
/// Parts of the source that labels are judged by while they are learned from the others.
const FOLDS: usize = 5;
/// Points of a region that count as independent, at most.
const INDEPENDENT: f64 = 4.0;
/// Standard deviation of a normal distribution over its median deviation.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Largest deviation that chance gives the log-likelihood of a region: rooms that are alike differ by less.
const BY_CHANCE: f64 = 2.5;
/// Deviations by the median beyond which a region differs by more than chance: its difference counts as so large.
const HEAVY: f64 = 4.0;
/// Target points that a source point may belong to.
const NEIGHBORS: usize = 4;

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

/// Deviations across surfaces that a pose may turn out to have, as parts of the expected one: each variance is half of
/// the one before.
const CLOSENESS: [f64; 5] = [
    1.0,
    std::f64::consts::FRAC_1_SQRT_2,
    0.5,
    0.5 * std::f64::consts::FRAC_1_SQRT_2,
    0.25,
];

#[derive(Clone, Copy, Debug)]
struct Partner {
    target: u32,
    /// Likelihood that they are one place by all but their distance across the surface, 1 at most.
    beside: f64,
    /// Squared distance across the surface in expected deviations.
    across: f64,
}

impl Partner {
    const NONE: Partner = Partner {
        target: 0,
        beside: 0.0,
        across: 0.0,
    };

    /// Adds the likelihoods that they are one place by each of the [`CLOSENESS`].
    fn add_to(&self, nearness: &mut [f64; CLOSENESS.len()]) {
        let mut across = (-0.5 * self.across).exp();
        for (sum, closeness) in nearness.iter_mut().zip(CLOSENESS) {
            *sum += self.beside / closeness * across;
            // Half of a variance squares it.
            across *= across;
        }
    }

    /// Likelihood that they are one place, if the deviation across surfaces is `closeness` of the expected
    /// one; 1 over that at most.
    fn nearness(&self, closeness: f64) -> f64 {
        if self.beside > 0.0 {
            self.beside / closeness * (-0.5 * self.across / (closeness * closeness)).exp()
        } else {
            0.0
        }
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

/// Source points with their partners at a pose.
pub struct Partners {
    of_point: Vec<[Partner; NEIGHBORS]>,
    /// Root mean square distance across the surfaces of points with a partner, metres.
    pub rmse_m: f64,
    /// Share of the points that have a partner.
    pub inlier_fraction: f64,
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
    pub fn nowhere(&self) -> f64 {
        self.observations() * log_density(0.0)
    }

    /// Finds the partners of all source points.
    pub fn partners(&self, target_from_source: &Isometry3<f64>) -> Partners {
        self.partners_at(&target_from_source.rotation, |p| target_from_source * p)
    }

    /// The same with the distances of the points from a centre multiplied by a scale; regions and weights stay.
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

    /// Partners of a point at its place, and its squared distance across the surface of the nearest.
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
        let both: f64 = points
            .map(|i| self.of_point(i, partners, closeness, &lifts))
            .sum();
        let likelihood = Likelihood {
            surfaces,
            labels: both - surfaces,
        };
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

    /// Standard deviation that chance gives the difference of the log-likelihoods of two poses by surfaces.
    ///
    /// From the scatter of the differences of regions of `region_m` about their median, where both poses
    /// have the points on the map: where only one has, that is no chance.
    pub fn noise_between(&self, poses: [&Isometry3<f64>; 2], region_m: f64) -> f64 {
        let [a, b] = poses.map(|pose| self.of_regions(pose, region_m));
        let both = a.into_values().zip(b.into_values());
        let both = both.filter(|(a, b)| *a > 0.0 && *b > 0.0);
        let mut differences: Vec<f64> = both.map(|(a, b)| a - b).collect();
        let middle = quantile(&mut differences, 0.5);
        let mut deviations: Vec<f64> = differences.iter().map(|d| (d - middle).abs()).collect();
        let most = HEAVY * DEVIATION_OF_MEDIAN * quantile(&mut deviations, 0.5);
        let squared: f64 = deviations.iter().map(|d| d.min(most).powi(2)).sum();
        let n = deviations.len() as f64;
        squared.sqrt().min(BY_CHANCE * n.sqrt())
    }

    /// Log-likelihood by surfaces of each region of a side.
    fn of_regions(&self, pose: &Isometry3<f64>, region_m: f64) -> BTreeMap<[i64; 3], f64> {
        let partners = self.partners(pose);
        let (_, closeness) = self.closest(&partners);
        let mut regions = BTreeMap::new();
        for (i, point) in self.source.points_m().iter().enumerate() {
            let region = region_of(point, region_m);
            *regions.entry(region).or_default() += self.of_point(i, &partners, closeness, &[]);
        }
        regions
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
        let nowhere = log_density(0.0);
        let mut sums = [0.0; CLOSENESS.len()];
        for (near, weight) in partners.of_point.iter().zip(&self.weights) {
            let mut nearness = [0.0; CLOSENESS.len()];
            let mut near = near.iter().filter(|p| p.beside > 0.0).peekable();
            let is_nowhere = near.peek().is_none();
            near.for_each(|partner| partner.add_to(&mut nearness));
            for (sum, nearness) in sums.iter_mut().zip(nearness) {
                *sum += weight
                    * match is_nowhere {
                        true => nowhere,
                        false => log_density(nearness),
                    };
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

/// Value below which a share of all is; 0 of none.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = (share * values.len() as f64) as usize;
    let at = at.min(values.len().saturating_sub(1));
    match values.is_empty() {
        true => 0.0,
        false => *values.select_nth_unstable_by(at, f64::total_cmp).1,
    }
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
