//! Count and sum of the points in one cell.

/// Unit of all payload sums, metres: 2^-20 m, approximately one micrometre.
pub const OFFSET_UNIT_M: f64 = 1.0 / (1_u64 << 20) as f64;

/// Points in one cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Voxel {
    /// Number of points; saturates at `u32::MAX`, from which the mean offset is invalid.
    pub count: u32,
    /// Sum of point minus cell centre, in [`OFFSET_UNIT_M`].
    pub sum: [i64; 3],
}

impl Voxel {
    /// Mean of point minus cell centre, metres; zero without points.
    pub fn mean_offset_m(&self) -> [f64; 3] {
        let scale = OFFSET_UNIT_M / f64::from(self.count.max(1));
        self.sum.map(|s| s as f64 * scale)
    }

    /// Adds the points of another voxel; commutative and associative, also beyond saturation.
    #[inline]
    pub(super) fn add(&mut self, other: &Voxel) {
        self.count = self.count.saturating_add(other.count);
        for (sum, other) in self.sum.iter_mut().zip(other.sum) {
            *sum = sum.wrapping_add(other);
        }
    }

    /// Contradiction in this voxel, given that no point is more than `reach` units from the centre.
    pub(super) fn contradiction(&self, reach: u64) -> Option<String> {
        if self.count == 0 {
            return Some("a voxel without points".to_owned());
        }
        let limit = u128::from(self.count) * u128::from(reach);
        let beyond = self
            .sum
            .iter()
            .any(|s| u128::from(s.unsigned_abs()) > limit);
        (beyond && self.count < u32::MAX).then(|| {
            format!(
                "offset sums {:?} of {} points leave the cell",
                self.sum, self.count
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_in_metres() {
        let voxel = Voxel {
            count: 4,
            sum: [1 << 20, -(1 << 21), 0],
        };
        assert_eq!(voxel.mean_offset_m(), [0.25, -0.5, 0.0]);
        assert_eq!(Voxel::default().mean_offset_m(), [0.0; 3]);
    }

    #[test]
    fn the_count_saturates_in_any_order() {
        let parts = [u32::MAX - 1, 7, 3].map(|count| Voxel {
            count,
            sum: [i64::MAX, -5, 1],
        });
        let total = |order: [usize; 3]| {
            let mut voxel = Voxel::default();
            order.iter().for_each(|&i| voxel.add(&parts[i]));
            voxel
        };
        assert_eq!(total([0, 1, 2]), total([2, 1, 0]));
        assert_eq!(total([0, 1, 2]).count, u32::MAX);
    }
}
