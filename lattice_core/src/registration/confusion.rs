//! Label co-occurrence of two segmenters, learned during registration.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{LabelDistribution, PreparedCloud};

/// Weight of the prior, in observations.
const PRIOR_MASS: f64 = 30.0;
/// Bounds of the lift, so that no pair of labels alone determines a correspondence.
const MIN_LIFT: f64 = 0.05;
const MAX_LIFT: f64 = 20.0;
/// Maximum number of distinguished classes per segmenter; others count as unknown.
const MAX_CLASSES: usize = 64;
/// Maximum number of kept observations; above it, all are scaled down.
const MAX_MASS: f64 = 2_000.0;

/// Counts of corresponding source and target classes.
///
/// The label sets may differ. Accumulated over registrations, the counts make consistent disagreement informative and
/// unrelated labels neutral.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Confusion {
    /// Source class, target class, observations.
    pairs: Vec<(u16, u16, f64)>,
}

impl Confusion {
    /// Co-occurrence with negligible observations of all class pairs of two clouds, whose lift is that of the prior.
    pub(super) fn unseen(source: &[(u16, f64)], target: &[(u16, f64)]) -> Confusion {
        let pairs = source
            .iter()
            .flat_map(|(a, p)| target.iter().map(move |(b, q)| (*a, *b, p * q * 1e-3)));
        Confusion {
            pairs: pairs.collect(),
        }
    }

    /// Number of observations.
    pub fn mass(&self) -> f64 {
        self.pairs.iter().map(|p| p.2).sum()
    }

    /// Observations of each pair of a source class and a target class, in order.
    pub fn pairs(&self) -> &[(u16, u16, f64)] {
        &self.pairs
    }

    /// Tests whether the counts are valid, for a table read from a file.
    pub fn is_valid(&self) -> bool {
        let finite = self.pairs.iter().all(|p| p.2 >= 0.0 && p.2.is_finite());
        finite && self.pairs.len() <= MAX_CLASSES * MAX_CLASSES && self.mass() < 1e12
    }

    /// Sums the observations of both, scaled down to the maximum.
    pub fn merged(&self, other: &Confusion) -> Confusion {
        let mut sums = Counts::default();
        for (a, b, mass) in self.pairs.iter().chain(&other.pairs) {
            *sums.0.entry((*a, *b)).or_default() += mass;
        }
        let mut merged = sums.confusion();
        let scale = (MAX_MASS / merged.mass().max(MAX_MASS)).min(1.0);
        for pair in &mut merged.pairs {
            pair.2 *= scale;
        }
        merged
    }

    /// Fraction of a source class's observations with the same target class number, and the number of its
    /// observations.
    pub fn agreement(&self, class: u16) -> (f64, f64) {
        let of = |keep: &dyn Fn(&(u16, u16, f64)) -> bool| -> f64 {
            // `sum` of nothing is -0.
            let kept = self.pairs.iter().filter(|p| keep(p));
            kept.fold(0.0, |sum, p| sum + p.2)
        };
        let all = of(&|p| p.0 == class);
        let same = of(&|p| p.0 == class && p.1 == class);
        (if all > 0.0 { same / all } else { 0.0 }, all)
    }

    /// Lift of each pair of classes, P(a, b) / (P(a) P(b)) over correspondences.
    ///
    /// `agreement` is the prior fraction of correspondences with equal class numbers; 0 if the label sets are
    /// unrelated. Observations outweigh it.
    pub fn lift(&self, agreement: f64) -> Lift {
        let source = Classes::of(self.pairs.iter().map(|p| p.0));
        let target = Classes::of(self.pairs.iter().map(|p| p.1));
        let (rows, columns) = (source.names.len(), target.names.len());
        let mut joint = vec![0.0; rows * columns];
        for (a, b, mass) in &self.pairs {
            let at = source.index(*a).zip(target.index(*b));
            if let Some(slot) = at.and_then(|(a, b)| joint.get_mut(a * columns + b)) {
                *slot += mass;
            }
        }
        let n: f64 = joint.iter().sum();
        let (p, q) = marginals(&joint, rows, columns, n.max(1e-9));
        let prior = |a: usize, b: usize| {
            let independent = p[a] * q[b];
            let equal = source.names[a] == target.names[b];
            // Frequency of correspondences of equal classes if the label sets agree.
            agreement * if equal { p[a].min(q[b]) } else { 0.0 } + (1.0 - agreement) * independent
        };
        let priors: Vec<f64> = (0..rows * columns)
            .map(|i| prior(i / columns.max(1), i % columns.max(1)))
            .collect();
        let sum: f64 = priors.iter().sum::<f64>().max(1e-9);
        for (joint, prior) in joint.iter_mut().zip(&priors) {
            *joint = (*joint + PRIOR_MASS * prior / sum) / (n + PRIOR_MASS);
        }
        let (p, q) = marginals(&joint, rows, columns, 1.0);
        let lifts = joint.iter().enumerate().map(|(i, joint)| {
            let chance = p[i / columns] * q[i % columns];
            (joint / chance.max(1e-12)).clamp(MIN_LIFT, MAX_LIFT)
        });
        Lift {
            table: lifts.collect(),
            source,
            target,
        }
    }
}

/// Fractions of the most frequent classes, in the order of their numbers.
pub(super) fn shares(cloud: &PreparedCloud) -> Vec<(u16, f64)> {
    shares_of((0..cloud.len()).map(|i| cloud.label(i)))
}

fn shares_of(labels: impl Iterator<Item = LabelDistribution>) -> Vec<(u16, f64)> {
    let mut sums: BTreeMap<u16, f64> = BTreeMap::new();
    for label in labels {
        for (class, weight) in label.iter() {
            *sums.entry(class).or_default() += f64::from(weight);
        }
    }
    let all: f64 = sums.values().sum::<f64>().max(1e-9);
    let mut shares: Vec<(u16, f64)> = sums.into_iter().map(|(c, w)| (c, w / all)).collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares.truncate(MAX_CLASSES);
    shares.sort_by_key(|share| share.0);
    shares
}

/// Row and column sums of a joint distribution, divided by `n`.
fn marginals(joint: &[f64], rows: usize, columns: usize, n: f64) -> (Vec<f64>, Vec<f64>) {
    let mut p = vec![0.0; rows];
    let mut q = vec![0.0; columns];
    for (i, mass) in joint.iter().enumerate() {
        p[i / columns] += mass / n;
        q[i % columns] += mass / n;
    }
    (p, q)
}

/// Accumulator of label co-occurrence.
#[derive(Clone, Debug, Default)]
pub(super) struct Counts(BTreeMap<(u16, u16), f64>);

impl Counts {
    /// Adds a correspondence.
    pub fn add(&mut self, source: &LabelDistribution, target: &LabelDistribution, mass: f64) {
        for (a, p) in source.iter() {
            for (b, q) in target.iter() {
                *self.0.entry((a, b)).or_default() += mass * f64::from(p) * f64::from(q);
            }
        }
    }

    /// Adds other counts.
    pub fn add_all(&mut self, other: &Counts) {
        for (pair, mass) in &other.0 {
            *self.0.entry(*pair).or_default() += mass;
        }
    }

    /// Converts to a [`Confusion`], limited to the most frequent pairs.
    pub fn confusion(self) -> Confusion {
        let pairs = self.0.into_iter().map(|((a, b), mass)| (a, b, mass));
        let mut pairs: Vec<(u16, u16, f64)> = pairs.collect();
        if pairs.len() > MAX_CLASSES * MAX_CLASSES {
            pairs.sort_by(|a, b| b.2.total_cmp(&a.2));
            pairs.truncate(MAX_CLASSES * MAX_CLASSES);
            pairs.sort_by_key(|p| (p.0, p.1));
        }
        Confusion { pairs }
    }
}

/// Class numbers of one side and their indices in a table.
#[derive(Clone, Debug, Default)]
struct Classes {
    names: Vec<u16>,
    /// Index in `names` by class number, or `u8::MAX`.
    places: Vec<u8>,
}

impl Classes {
    fn of(classes: impl Iterator<Item = u16>) -> Classes {
        let mut names: Vec<u16> = classes.collect();
        names.sort_unstable();
        names.dedup();
        names.truncate(MAX_CLASSES);
        let mut places = vec![u8::MAX; names.last().map_or(0, |&last| usize::from(last) + 1)];
        for (i, &name) in names.iter().enumerate() {
            places[usize::from(name)] = i as u8;
        }
        Classes { names, places }
    }

    #[inline]
    fn index(&self, class: u16) -> Option<usize> {
        let place = *self.places.get(usize::from(class))?;
        (place != u8::MAX).then_some(usize::from(place))
    }
}

/// Ratio of the joint probability of two labels to that of independent ones; 1 is neutral.
#[derive(Clone, Debug, Default)]
pub struct Lift {
    source: Classes,
    target: Classes,
    table: Vec<f64>,
}

impl Lift {
    /// Lift of two classes; 1 for an unknown class.
    #[inline]
    pub fn of(&self, source: u16, target: u16) -> f64 {
        let at = self.source.index(source).zip(self.target.index(target));
        let at = at.and_then(|(a, b)| self.table.get(a * self.target.names.len() + b));
        at.copied().unwrap_or(1.0)
    }

    /// Expected lift of two distributions; the unknown part counts 1.
    #[inline]
    pub fn expected(&self, source: &LabelDistribution, target: &LabelDistribution) -> f64 {
        let (mut known, mut sum) = (0.0, 0.0);
        for (a, p) in source.iter() {
            for (b, q) in target.iter() {
                let both = f64::from(p) * f64::from(q);
                known += both;
                sum += both * self.of(a, b);
            }
        }
        sum + (1.0 - known).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learned(pairs: &[(u16, u16, f64)]) -> Confusion {
        let mut counts = Counts::default();
        for (a, b, mass) in pairs {
            counts.add(
                &LabelDistribution::hard(*a),
                &LabelDistribution::hard(*b),
                *mass,
            );
        }
        counts.confusion()
    }

    #[test]
    fn unrelated_labels_are_neutral() {
        let pairs: Vec<_> = [1, 2, 3]
            .into_iter()
            .flat_map(|a| [7, 8].map(|b| (a, b, f64::from(a) * f64::from(b) * 10.0)))
            .collect();
        let lift = learned(&pairs).lift(0.0);
        for (a, b, _) in pairs {
            assert!((lift.of(a, b) - 1.0).abs() < 1e-9);
        }
        assert_eq!(lift.of(1, 99), 1.0);
    }

    #[test]
    fn a_consistent_disagreement_becomes_evidence() {
        let lift = learned(&[(1, 1, 200.0), (2, 5, 200.0), (3, 3, 200.0)]).lift(0.5);
        assert!(lift.of(2, 5) > 2.0 && lift.of(1, 1) > 2.0);
        assert!(lift.of(2, 1) < 0.2);
        let soft = LabelDistribution::from_weights([(2, 0.5)]);
        let expected = 0.5 * lift.of(2, 5) + 0.5;
        assert!((lift.expected(&soft, &LabelDistribution::hard(5)) - expected).abs() < 1e-9);
        assert_eq!(lift.expected(&LabelDistribution::UNKNOWN, &soft), 1.0);
    }

    #[test]
    fn without_much_evidence_equal_numbers_are_expected_to_agree() {
        let few = learned(&[(1, 1, 1.0), (2, 2, 1.0), (1, 2, 1.0)]);
        let lift = few.lift(0.6);
        assert!(lift.of(1, 1) > lift.of(1, 2));
        let apart = few.lift(0.0);
        assert!(lift.of(1, 1) > apart.of(1, 1));
    }

    #[test]
    fn unseen_classes_are_expected_to_agree_as_far_as_they_are_shared() {
        let source = [1, 1, 2].map(LabelDistribution::hard);
        let target = [2, 3].map(LabelDistribution::hard);
        let unseen = Confusion::unseen(
            &shares_of(source.into_iter()),
            &shares_of(target.into_iter()),
        );
        let lift = unseen.lift(0.6);
        assert!(lift.of(2, 2) > 1.2 && lift.of(2, 2) > lift.of(2, 3));
        assert!((unseen.lift(0.0).of(2, 2) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn observations_add_up_and_fade() {
        let a = learned(&[(1, 1, 900.0), (1, 2, 100.0)]);
        let both = a.merged(&a).merged(&a);
        assert!((both.mass() - MAX_MASS).abs() < 1e-6);
        assert!((both.agreement(1).0 - 0.9).abs() < 1e-9);
        assert_eq!(both.agreement(5), (0.0, 0.0));
        assert!(learned(&[(1, 2, 5.0)]).agreement(1).0.is_sign_positive());
        assert!(both.is_valid());
        let back: Confusion = learned(&[(1, 1, f64::NAN)]);
        assert!(!back.is_valid());
    }
}
