//! Rectangle of a published grid.

use lattice_core::navigation::Grid;

/// Place and size of a grid, in cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub corner: [i32; 2],
    pub width: usize,
    pub height: usize,
}

impl Window {
    /// Rectangle of a grid.
    pub(super) fn of(grid: &Grid) -> Self {
        Self {
            corner: grid.corner,
            width: grid.width,
            height: grid.height,
        }
    }

    /// True if another rectangle is inside.
    pub(super) fn contains(&self, other: &Self) -> bool {
        let inside = |axis: usize, mine: usize, theirs: usize| {
            let begin = |window: &Self| window.corner.get(axis).map_or(0, |i| i64::from(*i));
            let end = |window: &Self, length: usize| begin(window) + length as i64;
            begin(self) <= begin(other) && end(other, theirs) <= end(self, mine)
        };
        other.width == 0
            || inside(0, self.width, other.width) && inside(1, self.height, other.height)
    }

    /// The rectangle with cells added on each side.
    pub(super) fn with_room(&self, cells: u32) -> Self {
        let room = i32::try_from(cells).unwrap_or(i32::MAX).min(1 << 20);
        Self {
            corner: self.corner.map(|i| i.saturating_sub(room)),
            width: self.width + 2 * room as usize,
            height: self.height + 2 * room as usize,
        }
    }
}
