//! Class probabilities of pixels, limited to the most probable classes.

use lattice_core::registration::UNLABELED;

use super::labels::Classes;

/// Classes kept per pixel, as many as registration uses.
pub const SHARES: usize = 4;
/// Limit of probability elements per point.
const MAX_ELEMENTS: usize = 256;

/// A class of a pixel with its probability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// The class.
    pub class: u16,
    /// Probability of the label; 65535 is one.
    parts: u16,
}

impl Share {
    /// No class.
    pub const NONE: Self = Self {
        class: UNLABELED,
        parts: 0,
    };

    /// Class with a probability from 0 to 1; NaN counts as 0.
    pub fn new(class: u16, probability: f32) -> Self {
        Self {
            class,
            parts: (probability * 65535.0).round() as u16,
        }
    }

    /// Probability, 0 to 1.
    pub fn probability(self) -> f32 {
        f32::from(self.parts) / 65535.0
    }
}

/// Most probable classes of each pixel, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SoftLabels {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Number of classes.
    classes: usize,
    pixels: Vec<[Share; SHARES]>,
}

impl SoftLabels {
    /// Probabilities of an image; `None` if their number does not match its pixels.
    pub fn new(
        [width, height]: [usize; 2],
        classes: usize,
        pixels: Vec<[Share; SHARES]>,
    ) -> Option<Self> {
        let is_whole = width > 0 && height > 0 && width.checked_mul(height) == Some(pixels.len());
        is_whole.then_some(Self {
            width,
            height,
            classes,
            pixels,
        })
    }

    /// Probabilities without pixels.
    #[cfg(test)]
    pub fn none(classes: usize) -> Self {
        Self {
            width: 0,
            height: 0,
            classes,
            pixels: Vec::new(),
        }
    }

    /// Elements of a list with one per possible class; 0: none, or more than the limit.
    pub fn elements(&self, classes: &Classes) -> usize {
        let numbers = (0..=UNLABELED).take(self.classes);
        let known = numbers.filter_map(|number| classes.known(number, 1.0));
        let most = known.max().map_or(0, |class| usize::from(class) + 1);
        if most > MAX_ELEMENTS { 0 } else { most }
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        size_of_val(self.pixels.as_slice())
    }

    /// Classes of a pixel.
    pub fn at(&self, column: usize, row: usize) -> [Share; SHARES] {
        let place = row.saturating_mul(self.width).saturating_add(column);
        let found = self.pixels.get(place).filter(|_| column < self.width);
        found.copied().unwrap_or([Share::NONE; SHARES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::ClassRules;

    #[test]
    fn elements_are_as_many_as_classes_that_points_may_have() {
        let elements =
            |classes, rules: &ClassRules| SoftLabels::none(classes).elements(&Classes::new(rules));
        let all = ClassRules::default();
        assert_eq!(elements(13, &all), 13);
        assert_eq!(elements(257, &all), 0);
        let far = ClassRules {
            groups: [(0, 900)].into(),
            ..ClassRules::default()
        };
        assert_eq!(elements(2, &far), 0);
        let none = ClassRules {
            ignored: [0, 1].into(),
            ..ClassRules::default()
        };
        assert_eq!(elements(2, &none), 0);
    }

    #[test]
    fn pixels_outside_know_nothing() {
        let share = Share::new(3, 0.25);
        assert!((share.probability() - 0.25).abs() < 1e-5);
        assert_eq!(Share::new(3, f32::NAN).probability(), 0.0);
        let pixel = [share, Share::NONE, Share::NONE, Share::NONE];
        let soft = SoftLabels::new([2, 1], 4, vec![pixel; 2]).unwrap();
        assert_eq!(soft.at(1, 0), pixel);
        assert_eq!(soft.at(2, 0), [Share::NONE; SHARES]);
        assert_eq!(soft.at(0, 1), [Share::NONE; SHARES]);
        assert_eq!(SoftLabels::new([2, 2], 4, vec![pixel; 2]), None);
    }
}
