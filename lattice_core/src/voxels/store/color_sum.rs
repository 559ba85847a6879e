//! Colours of the points in a voxel, as exact sums.

/// Sums of the colours of the coloured points in a voxel.
///
/// Sums are exact up to `u32::MAX - 1` coloured points. A voxel of more is saturated: its count is `u32::MAX`, its sums
/// are zero, and it has no mean colour. The order of the points does not matter, also beyond saturation.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ColorSum {
    /// Number of coloured points; `u32::MAX` if saturated.
    pub count: u32,
    /// Sums of red, green and blue, each from 0 to 255 for a point.
    pub sum: [u64; 3],
}

impl ColorSum {
    /// More coloured points than are counted.
    pub const SATURATED: ColorSum = ColorSum {
        count: u32::MAX,
        sum: [0; 3],
    };

    /// Sum of one point.
    pub fn of_point(rgb: [u8; 3]) -> ColorSum {
        ColorSum {
            count: 1,
            sum: rgb.map(u64::from),
        }
    }

    /// Sum of `count` points of one colour.
    pub fn of_points(rgb: [u8; 3], count: u32) -> ColorSum {
        match count {
            u32::MAX => ColorSum::SATURATED,
            _ => ColorSum {
                count,
                sum: rgb.map(|value| u64::from(value) * u64::from(count)),
            },
        }
    }

    /// Mean red, green and blue, rounded; `None` without coloured points and if saturated.
    pub fn mean(&self) -> Option<[u8; 3]> {
        let count = u64::from(self.count);
        if count == 0 || *self == ColorSum::SATURATED {
            return None;
        }
        // The mean of bytes is a byte.
        let mean = |sum: u64| u8::try_from((2 * sum + count) / (2 * count)).unwrap_or(u8::MAX);
        Some(self.sum.map(mean))
    }

    /// Adds the colours of other points; commutative and associative.
    pub fn add(&mut self, other: &ColorSum) {
        match self.count.saturating_add(other.count) {
            u32::MAX => *self = ColorSum::SATURATED,
            count => {
                self.count = count;
                for (sum, more) in self.sum.iter_mut().zip(other.sum) {
                    *sum = sum.saturating_add(more);
                }
            }
        }
    }

    /// Contradiction in these sums, given the number of points in the voxel.
    pub(crate) fn contradiction(&self, points: u32) -> Option<String> {
        let ColorSum { count, sum } = *self;
        if count > points {
            return Some(format!("{count} coloured points of {points}"));
        }
        let most = match count {
            u32::MAX => 0,
            count => 255 * u64::from(count),
        };
        (sum.iter().any(|sum| *sum > most))
            .then(|| format!("colour sums {sum:?} of {count} coloured points exceed {most}"))
    }
}

/// [`ColorSum`] in 20 bytes: the sums have 40 bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct PackedColor {
    count: u32,
    low: [u32; 3],
    high: [u8; 3],
}

impl PackedColor {
    pub(crate) fn add(&mut self, other: &ColorSum) {
        if other.count > 0 {
            let mut sum = ColorSum::from(*self);
            sum.add(other);
            *self = PackedColor::from(sum);
        }
    }
}

impl From<PackedColor> for ColorSum {
    fn from(packed: PackedColor) -> ColorSum {
        let PackedColor { count, low, high } = packed;
        let [r, g, b] = low.map(u64::from);
        let [r_high, g_high, b_high] = high.map(|high| u64::from(high) << 32);
        ColorSum {
            count,
            sum: [r | r_high, g | g_high, b | b_high],
        }
    }
}

impl From<ColorSum> for PackedColor {
    fn from(color: ColorSum) -> PackedColor {
        PackedColor {
            count: color.count,
            low: color.sum.map(|sum| sum as u32),
            high: color.sum.map(|sum| (sum >> 32) as u8),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_voxel_costs_twenty_bytes() {
        assert_eq!(size_of::<PackedColor>(), 20);
    }

    #[test]
    fn the_mean_is_rounded() {
        let mut sum = ColorSum::of_point([255, 0, 10]);
        assert_eq!(sum.mean(), Some([255, 0, 10]));
        sum.add(&ColorSum::of_point([254, 1, 10]));
        assert_eq!(sum.mean(), Some([255, 1, 10]));
        assert_eq!(ColorSum::default().mean(), None);
    }

    #[test]
    fn colours_saturate_in_any_order_and_never_wrap() {
        let parts = [u32::MAX - 3, 2, 1].map(|count| ColorSum::of_points([255, 1, 0], count));
        let total = |order: &[usize]| {
            let mut sum = PackedColor::default();
            order.iter().for_each(|&i| sum.add(&parts[i]));
            ColorSum::from(sum)
        };
        let most = total(&[0, 1]);
        assert_eq!((most.count, most.mean()), (u32::MAX - 1, Some([255, 1, 0])));
        assert_eq!(most.contradiction(u32::MAX), None);
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            assert_eq!(total(&order), ColorSum::SATURATED);
        }
        assert_eq!(ColorSum::SATURATED.mean(), None);
        assert_eq!(ColorSum::SATURATED.contradiction(u32::MAX), None);
    }

    proptest! {
        #[test]
        fn sums_are_packed_without_loss(count in 0..u32::MAX, shares in prop::array::uniform3(0.0..=1.0_f64)) {
            let most = 255 * u64::from(count);
            let sum = shares.map(|share| ((share * most as f64) as u64).min(most));
            let color = ColorSum { count, sum };
            prop_assert_eq!(color.contradiction(count), None);
            prop_assert_eq!(ColorSum::from(PackedColor::from(color)), color);
        }
    }
}
