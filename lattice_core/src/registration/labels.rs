//! Distribution of the semantic classes of a point.

/// Class number of a point without a label, as in `vision_msgs/LabelInfo`.
pub const UNLABELED: u16 = u16::MAX;

/// Number of stored classes.
const KEPT: usize = 4;

/// Probabilities of the most probable classes of a point; the remainder to 1 is unknown.
///
/// Class numbers are those of one segmenter; two clouds may use different label sets.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LabelDistribution {
    classes: [u16; KEPT],
    weights: [f32; KEPT],
}

impl LabelDistribution {
    /// Distribution of a point of unknown class.
    pub const UNKNOWN: LabelDistribution = LabelDistribution {
        classes: [UNLABELED; KEPT],
        weights: [0.0; KEPT],
    };

    /// Distribution of one class with probability 1; unknown for [`UNLABELED`].
    pub fn hard(class: u16) -> LabelDistribution {
        LabelDistribution::from_weights([(class, 1.0)])
    }

    /// Distribution of the four largest weights, normalized if their sum exceeds 1.
    ///
    /// Weights that are not positive and finite, and the class [`UNLABELED`], are excluded from the classes; a
    /// positive weight of [`UNLABELED`] counts in the sum. Each class occurs once. Of equal weights, the first come
    /// first.
    pub fn from_weights(weights: impl IntoIterator<Item = (u16, f32)>) -> LabelDistribution {
        let mut kept = LabelDistribution::UNKNOWN;
        let mut sum = 0.0;
        for (class, weight) in weights {
            if !(weight > 0.0 && weight.is_finite()) {
                continue;
            }
            sum += weight;
            if class != UNLABELED {
                kept.place(class, weight);
            }
        }
        let scale = f32::max(sum, 1.0);
        kept.weights = kept.weights.map(|w| w / scale);
        kept
    }

    /// Inserts a class by descending weight and drops the smallest.
    fn place(&mut self, mut class: u16, mut weight: f32) {
        for i in 0..KEPT {
            if weight > self.weights[i] {
                std::mem::swap(&mut class, &mut self.classes[i]);
                std::mem::swap(&mut weight, &mut self.weights[i]);
            }
        }
    }

    /// Classes with their probabilities, the most probable first.
    pub fn iter(&self) -> impl Iterator<Item = (u16, f32)> + '_ {
        let pairs = self.classes.into_iter().zip(self.weights);
        pairs.take_while(|(_, weight)| *weight > 0.0)
    }

    /// Most probable class.
    pub fn top(&self) -> Option<u16> {
        self.iter().next().map(|(class, _)| class)
    }

    /// Probability of none of the stored classes.
    pub fn unknown(&self) -> f32 {
        (1.0 - self.weights.iter().sum::<f32>()).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_weights_are_kept_in_order_and_normalised() {
        let weights = [
            (7, 1.0),
            (3, 4.0),
            (9, 2.0),
            (1, 0.5),
            (2, 1.5),
            (UNLABELED, 1.0),
        ];
        let kept = LabelDistribution::from_weights(weights);
        let expected = [(3, 0.4), (9, 0.2), (2, 0.15), (7, 0.1)];
        assert_eq!(kept.iter().collect::<Vec<_>>(), expected);
        assert_eq!(kept.top(), Some(3));
        assert!((kept.unknown() - 0.15).abs() < 1e-6);
    }

    #[test]
    fn probabilities_below_one_stay() {
        let kept = LabelDistribution::from_weights([(5, 0.25), (6, f32::NAN), (8, -1.0)]);
        assert_eq!(kept.iter().collect::<Vec<_>>(), [(5, 0.25)]);
        assert_eq!(kept.unknown(), 0.75);
    }

    #[test]
    fn no_label_is_unknown() {
        assert_eq!(
            LabelDistribution::hard(UNLABELED),
            LabelDistribution::UNKNOWN
        );
        assert_eq!(LabelDistribution::UNKNOWN.unknown(), 1.0);
        assert_eq!(LabelDistribution::hard(4).top(), Some(4));
    }
}
