//! Scatter of the difference of the likelihoods of two poses that are equally right.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::{Fit, region_of};

/// Standard deviation of a normal distribution over its median deviation.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Largest deviation that chance gives the log-likelihood of a region: rooms that are alike differ by less.
const BY_CHANCE: f64 = 2.5;
/// Standard deviations, estimated by the median, to which the difference of a region is clipped (winsorised).
const HEAVY: f64 = 4.0;

/// Log-likelihoods of regions.
type Regions = BTreeMap<[i64; 3], f64>;

impl Fit<'_> {
    /// Standard deviation that chance gives the difference of the log-likelihoods of a pose and each of others by surfaces.
    ///
    /// From the scatter of the differences of regions of `region_m` about their median, where both poses
    /// have the points on the map: where only one has, that is no chance.
    pub fn noise_between(
        &self,
        pose: &Isometry3<f64>,
        others: &[&Isometry3<f64>],
        region_m: f64,
    ) -> Vec<f64> {
        let here = self.of_regions(pose, region_m);
        let there = others.par_iter();
        let noise = there.map(|other| noise(&here, &self.of_regions(other, region_m)));
        noise.collect()
    }

    /// Log-likelihood by surfaces of each region of a side.
    fn of_regions(&self, pose: &Isometry3<f64>, region_m: f64) -> Regions {
        let partners = self.partners(pose);
        let (_, closeness) = self.closest(&partners);
        let mut regions = Regions::new();
        for (i, point) in self.source.points_m().iter().enumerate() {
            let region = region_of(point, region_m);
            *regions.entry(region).or_default() += self.of_point(i, &partners, closeness, &[]);
        }
        regions
    }
}

/// Standard deviation of the difference of the log-likelihoods of two poses, given those of their regions.
fn noise(a: &Regions, b: &Regions) -> f64 {
    let both = a.values().zip(b.values());
    let both = both.filter(|(a, b)| **a > 0.0 && **b > 0.0);
    let mut differences: Vec<f64> = both.map(|(a, b)| a - b).collect();
    let middle = quantile(&mut differences, 0.5);
    let mut deviations: Vec<f64> = differences.iter().map(|d| (d - middle).abs()).collect();
    let most = HEAVY * DEVIATION_OF_MEDIAN * quantile(&mut deviations, 0.5);
    let squared: f64 = deviations.iter().map(|d| d.min(most).powi(2)).sum();
    let n = deviations.len() as f64;
    squared.sqrt().min(BY_CHANCE * n.sqrt())
}

/// Value below which a share of all is; 0 of none.
pub(in crate::registration) fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = (share * values.len() as f64) as usize;
    let at = at.min(values.len().saturating_sub(1));
    match values.is_empty() {
        true => 0.0,
        false => *values.select_nth_unstable_by(at, f64::total_cmp).1,
    }
}
