//! Difference of the log-likelihoods of two poses from regions that fit both about equally well, and its scatter.

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::fit::{Fit, region_of};

/// Ratio of the standard deviation of a normal distribution to its median absolute deviation.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Maximum standard deviation of the log-likelihood of a region; alike rooms differ by less.
const MAX_REGION_SIGMA: f64 = 2.5;
/// Winsorization limit of the difference of a region, in robust standard deviations.
const CLIP_SIGMAS: f64 = 4.0;
/// Difference of the log-likelihoods of a cell from which it is distinct: only one pose has inliers there.
const DISTINCT: f64 = 5.0;

/// Part of a log-likelihood difference by surfaces that does not distinguish two poses.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct IndistinctDifference {
    /// Difference from cells that fit both poses about equally well.
    pub difference: f64,
    /// Standard deviation of the difference if both poses are equally right.
    pub sigma: f64,
}

impl Fit<'_> {
    /// Indistinct log-likelihood differences by surfaces between a pose and each of others.
    ///
    /// Their standard deviation comes from the differences of regions of `region_m` about their median. Only regions
    /// with inliers at both poses count.
    pub fn indistinct_differences(
        &self,
        pose: &Isometry3<f64>,
        others: &[&Isometry3<f64>],
        region_m: f64,
    ) -> Vec<IndistinctDifference> {
        let here = self.of_points(pose);
        let [cells, regions] = [self.scale.region_m, region_m].map(|side_m| self.regions(side_m));
        let there = others.par_iter();
        let differences = there.map(|other| {
            let both: Vec<(f64, f64)> = (here.iter().copied()).zip(self.of_points(other)).collect();
            IndistinctDifference {
                difference: indistinct(&sums(&both, &cells)),
                sigma: noise(&sums(&both, &regions)),
            }
        });
        differences.collect()
    }

    /// Log-likelihood by surfaces of each point.
    fn of_points(&self, pose: &Isometry3<f64>) -> Vec<f64> {
        let partners = self.partners(pose);
        let (_, closeness) = self.closest(&partners);
        let of_point = |i| self.of_point(i, &partners, closeness, &[]);
        (0..self.source.len()).map(of_point).collect()
    }

    /// Index of the region of each point, in the order of the region keys.
    fn regions(&self, side_m: f64) -> Vec<usize> {
        let of_points = self.source.points_m().iter();
        let of_points: Vec<[i64; 3]> = of_points.map(|point| region_of(point, side_m)).collect();
        let mut regions = of_points.clone();
        regions.sort_unstable();
        regions.dedup();
        let number = |region| regions.partition_point(|other| other < region);
        of_points.iter().map(number).collect()
    }
}

/// Sums the log-likelihoods of points at two poses by region.
fn sums(of_points: &[(f64, f64)], regions: &[usize]) -> Vec<(f64, f64)> {
    let n = regions.iter().max().map_or(0, |last| last + 1);
    let mut sums = vec![(0.0, 0.0); n];
    for ((a, b), region) in of_points.iter().zip(regions) {
        if let Some(sum) = sums.get_mut(*region) {
            *sum = (sum.0 + a, sum.1 + b);
        }
    }
    sums
}

/// Sums the differences of cells that are not distinct.
fn indistinct(cells: &[(f64, f64)]) -> f64 {
    let differences = cells.iter().map(|(a, b)| a - b);
    differences.filter(|d| d.abs() <= DISTINCT).sum()
}

/// Robust standard deviation of the total difference, from the differences of regions.
fn noise(regions: &[(f64, f64)]) -> f64 {
    let mut differences: Vec<f64> = on_both(regions).collect();
    let median = quantile(&mut differences, 0.5);
    let mut deviations: Vec<f64> = differences.iter().map(|d| (d - median).abs()).collect();
    let most = CLIP_SIGMAS * DEVIATION_OF_MEDIAN * quantile(&mut deviations, 0.5);
    let squared: f64 = deviations.iter().map(|d| d.min(most).powi(2)).sum();
    let n = deviations.len() as f64;
    squared.sqrt().min(MAX_REGION_SIGMA * n.sqrt())
}

/// Differences of the regions with inliers at both poses.
fn on_both(regions: &[(f64, f64)]) -> impl Iterator<Item = f64> {
    let both = regions.iter().filter(|(a, b)| *a > 0.0 && *b > 0.0);
    both.map(|(a, b)| a - b)
}

/// Quantile of `values` at `share` in 0..=1; 0 if there are none.
pub(in crate::registration) fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = (share * values.len() as f64) as usize;
    let at = at.min(values.len().saturating_sub(1));
    match values.is_empty() {
        true => 0.0,
        false => *values.select_nth_unstable_by(at, f64::total_cmp).1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_that_one_pose_alone_explains_are_distinct() {
        // Both poses explain the walls, one of them also a cube.
        let mut cells: Vec<(f64, f64)> = (0..99)
            .map(|i| (9.0, 9.0 + [-1.0, 0.0, 1.0][i % 3]))
            .collect();
        cells.push((8.0, 9.0));
        let (log, chance) = (indistinct(&cells), noise(&cells));
        assert!((log + 1.0).abs() < 1e-9);
        assert!((chance - 67.0_f64.sqrt()).abs() < 1e-9, "{chance}");
        cells.extend([(10.0, -5.0), (9.0, -6.0)]);
        assert_eq!((indistinct(&cells), noise(&cells)), (log, chance));
        // A single distinct cell does not widen the scatter either.
        cells.push((9.0, 1.0));
        assert!(noise(&cells) - chance < 2.0);
        assert_eq!((indistinct(&[]), noise(&[])), (0.0, 0.0));
    }
}
