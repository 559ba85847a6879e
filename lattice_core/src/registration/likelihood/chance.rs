//! Scatter of the difference of the likelihoods of two poses that are equally right.

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::{Fit, region_of};

/// Standard deviation of a normal distribution over its median deviation.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Largest deviation that chance gives the log-likelihood of a region: rooms that are alike differ by less.
const BY_CHANCE: f64 = 2.5;
/// Standard deviations, estimated by the median, to which the difference of a region is clipped (winsorised).
const HEAVY: f64 = 4.0;
/// Difference of the log-likelihoods of a cell from which on it is no chance: one pose has points on the map there.
const STANDS_OUT: f64 = 5.0;

/// Difference between the log-likelihoods by surfaces of two poses, as far as it may be chance.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Even {
    /// Part of the difference from where the points fit both poses about as well.
    pub log: f64,
    /// Standard deviation that chance gives it.
    pub chance: f64,
}

impl Fit<'_> {
    /// Differences between the log-likelihoods by surfaces of a pose and each of others, as far as they may be chance.
    ///
    /// Their deviation is that of the differences of regions of `region_m` about their median, where both poses
    /// have the points on the map: where only one has, that is no chance.
    pub fn even(
        &self,
        pose: &Isometry3<f64>,
        others: &[&Isometry3<f64>],
        region_m: f64,
    ) -> Vec<Even> {
        let here = self.of_points(pose);
        let [cells, regions] = [self.scale.region_m, region_m].map(|side_m| self.regions(side_m));
        let there = others.par_iter();
        let even = there.map(|other| {
            let both: Vec<(f64, f64)> = (here.iter().copied()).zip(self.of_points(other)).collect();
            Even {
                log: even(&sums(&both, &cells)),
                chance: noise(&sums(&both, &regions)),
            }
        });
        even.collect()
    }

    /// Log-likelihood by surfaces of each point.
    fn of_points(&self, pose: &Isometry3<f64>) -> Vec<f64> {
        let partners = self.partners(pose);
        let (_, closeness) = self.closest(&partners);
        let of_point = |i| self.of_point(i, &partners, closeness, &[]);
        (0..self.source.len()).map(of_point).collect()
    }

    /// Number of the region of a side that each point is in, in the order of their places.
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

/// Log-likelihoods of regions at two poses, given those of points and the numbers of their regions.
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

/// Part of the difference of the log-likelihoods of two poses, given those of cells, from those that do not stand out.
fn even(cells: &[(f64, f64)]) -> f64 {
    let differences = cells.iter().map(|(a, b)| a - b);
    differences.filter(|d| d.abs() <= STANDS_OUT).sum()
}

/// Standard deviation of the difference of the log-likelihoods of two poses, given those of regions.
fn noise(regions: &[(f64, f64)]) -> f64 {
    let mut differences: Vec<f64> = on_both(regions).collect();
    let median = quantile(&mut differences, 0.5);
    let mut deviations: Vec<f64> = differences.iter().map(|d| (d - median).abs()).collect();
    let most = HEAVY * DEVIATION_OF_MEDIAN * quantile(&mut deviations, 0.5);
    let squared: f64 = deviations.iter().map(|d| d.min(most).powi(2)).sum();
    let n = deviations.len() as f64;
    squared.sqrt().min(BY_CHANCE * n.sqrt())
}

/// Differences of those that both poses have on the map.
fn on_both(regions: &[(f64, f64)]) -> impl Iterator<Item = f64> {
    let both = regions.iter().filter(|(a, b)| *a > 0.0 && *b > 0.0);
    both.map(|(a, b)| a - b)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_pose_alone_explains_is_no_chance() {
        // Two poses explain walls alike, and one of them a cube too.
        let mut cells: Vec<(f64, f64)> = (0..99)
            .map(|i| (9.0, 9.0 + [-1.0, 0.0, 1.0][i % 3]))
            .collect();
        cells.push((8.0, 9.0));
        let (log, chance) = (even(&cells), noise(&cells));
        assert!((log + 1.0).abs() < 1e-9);
        assert!((chance - 67.0_f64.sqrt()).abs() < 1e-9, "{chance}");
        cells.extend([(10.0, -5.0), (9.0, -6.0)]);
        assert_eq!((even(&cells), noise(&cells)), (log, chance));
        // A single cell where they differ more is no measure of chance either.
        cells.push((9.0, 1.0));
        assert!(noise(&cells) - chance < 2.0);
        assert_eq!((even(&[]), noise(&[])), (0.0, 0.0));
    }
}
