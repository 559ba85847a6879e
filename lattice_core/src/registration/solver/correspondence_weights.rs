//! Weights of candidate correspondences by the labels and the distance of their points.

use nalgebra::{Point3, Vector3};

use super::correspondences::{Correspondences, Layer, NONE, Placed, Slot};
use crate::registration::{LabelDistribution, LabelUse, SemanticVariant};

/// Squared Mahalanobis distance at which inlier and outlier are equally likely.
const OUTLIER_SQUARED: f64 = 9.0;

impl Correspondences<'_> {
    /// Weights the candidates of a source point; those of weight zero are removed.
    pub(super) fn weigh(
        &self,
        variant: SemanticVariant,
        layer: &Layer,
        placed: &Placed,
        (i, q, m): (usize, &Point3<f64>, &Vector3<f64>),
        slots: &mut [Slot],
    ) {
        let source = label_at(self.labels.source, i);
        let (mut total, least) = (0.0, self.metric.min_determinant());
        for slot in slots.iter_mut().filter(|slot| slot.target != NONE) {
            let target = label_at(self.labels.target, slot.target as usize);
            let agreement = self.agreement(variant, &source, &target);
            let density = |over: f64| {
                let pair = self.pair(layer, placed, (q, m), slot.target);
                let spread = pair.information.determinant / over;
                (-0.5 * pair.squared() / self.scale).exp() / spread.sqrt()
            };
            slot.weight = match variant {
                SemanticVariant::Published => agreement,
                // |2 pi C|^(1/2)
                SemanticVariant::AsPrinted => agreement * density(std::f64::consts::TAU.powi(-3)),
                SemanticVariant::Em => agreement * density(least),
            };
            total += slot.weight;
        }
        let outlier = (-0.5 * OUTLIER_SQUARED).exp();
        for slot in slots {
            if variant == SemanticVariant::Em {
                slot.weight /= total + outlier;
            }
            if slot.weight.is_nan() || slot.weight <= 0.0 {
                slot.target = NONE;
            }
        }
    }

    /// Probability that two points have the same class (seed eq. 5, in brackets), or its replacement `pair_weight`.
    fn agreement(
        &self,
        variant: SemanticVariant,
        source: &LabelDistribution,
        target: &LabelDistribution,
    ) -> f64 {
        if let Some(pair_weight) = self.options.pair_weight {
            return pair_weight.expected(source, target);
        }
        let equal: f64 = match self.options.labels {
            LabelUse::Hard => match (source.top(), target.top()) {
                (Some(s), Some(t)) => f64::from(u8::from(s == t)),
                _ => 0.0,
            },
            LabelUse::Soft => overlap(source, target),
        };
        if variant != SemanticVariant::Em {
            return equal;
        }
        // Unknown labels agree with all classes.
        let unknown = |l: &LabelDistribution| match self.options.labels {
            LabelUse::Hard => f64::from(u8::from(l.top().is_none())),
            LabelUse::Soft => f64::from(l.unknown()),
        };
        let (s, t) = (unknown(source), unknown(target));
        equal + s + t - s * t
    }
}

/// Probability that two independent labels are equal.
fn overlap(source: &LabelDistribution, target: &LabelDistribution) -> f64 {
    let mut sum = 0.0;
    for (s, p) in source.iter() {
        for (t, q) in target.iter() {
            if s == t {
                sum += f64::from(p) * f64::from(q);
            }
        }
    }
    sum
}

fn label_at(labels: &[LabelDistribution], i: usize) -> LabelDistribution {
    labels.get(i).copied().unwrap_or(LabelDistribution::UNKNOWN)
}
