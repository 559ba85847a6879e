//! Row of a voxel.

use super::fixed_point::Point;

/// States of the list in which a voxel was added and last changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Life {
    pub(crate) born: u32,
    pub(crate) touched: u32,
}

impl Life {
    pub(super) fn ended(self, now: u32) -> Life {
        Life {
            born: self.born,
            touched: now,
        }
    }
}

/// Row of a voxel.
#[derive(Clone)]
pub(crate) struct Entry {
    pub(crate) code: u64,
    /// Sums of up to [`most_points`]; for more, the index of their [`WideSums`] and the count.
    pub(super) points: Point,
    pub(crate) life: Life,
}

impl Entry {
    /// Number of points; saturates at `u32::MAX`.
    #[inline(always)]
    pub(crate) fn count(&self) -> u32 {
        self.points.as_array()[3]
    }

    /// Index of the sums of a voxel with many points.
    pub(super) fn wide(&self) -> u32 {
        self.points.as_array()[0]
    }
}
