//! Rectangles that hold the differences of two grids.

use lattice_core::navigation::Grid;

/// Times that a rectangle is divided: Nav2 keeps the last ten updates.
const DIVISIONS: u32 = 2;
/// Part of the cells of a rectangle above which its halves are not worth a message each.
const WORTH: f64 = 0.7;

/// Cells of a grid from a corner, counted from the grid's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

/// At most four rectangles with all differences of two grids of one place and size.
pub(super) fn rectangles(before: &Grid, after: &Grid) -> Vec<Part> {
    let whole = Part {
        x: 0,
        y: 0,
        width: after.width,
        height: after.height,
    };
    let mut found = Vec::new();
    if let Some(part) = tight(before, after, &whole) {
        divide(before, after, part, DIVISIONS, &mut found);
    }
    found
}

fn divide(before: &Grid, after: &Grid, part: Part, divisions: u32, found: &mut Vec<Part>) {
    let halves = part.halves().map(|half| tight(before, after, &half));
    let cells = |part: &Part| (part.width * part.height) as f64;
    let sum: f64 = halves.iter().flatten().map(cells).sum();
    if divisions == 0 || sum > WORTH * cells(&part) {
        found.push(part);
        return;
    }
    for half in halves.into_iter().flatten() {
        divide(before, after, half, divisions - 1, found);
    }
}

impl Part {
    fn halves(&self) -> [Self; 2] {
        let (mut a, mut b) = (*self, *self);
        if self.width >= self.height {
            a.width = self.width / 2;
            b.width -= a.width;
            b.x += a.width;
        } else {
            a.height = self.height / 2;
            b.height -= a.height;
            b.y += a.height;
        }
        [a, b]
    }

    /// Indices of the cells of each row.
    pub(super) fn rows(&self, grid: &Grid) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let (stride, x, width) = (grid.width, self.x, self.width);
        (self.y..self.y + self.height).map(move |y| y * stride + x..y * stride + x + width)
    }
}

/// Smallest rectangle within a part with all of its differences.
fn tight(before: &Grid, after: &Grid, part: &Part) -> Option<Part> {
    let mut bounds: Option<[usize; 4]> = None;
    for (y, row) in (part.y..).zip(part.rows(after)) {
        let (Some(old), Some(new)) = (before.cells.get(row.clone()), after.cells.get(row)) else {
            continue;
        };
        let differs = |pair: (&_, &_)| pair.0 != pair.1;
        let mut pairs = old.iter().zip(new);
        let Some(first) = pairs.position(differs) else {
            continue;
        };
        let last = old.iter().zip(new).rposition(differs).unwrap_or(first);
        let [left, right] = [part.x + first, part.x + last];
        bounds = Some(match bounds {
            None => [left, right, y, y],
            Some([l, r, low, _]) => [l.min(left), r.max(right), low, y],
        });
    }
    bounds.map(|[left, right, low, high]| Part {
        x: left,
        y: low,
        width: right - left + 1,
        height: high - low + 1,
    })
}

#[cfg(test)]
mod tests {
    use lattice_core::navigation::Cell;
    use proptest::prelude::*;

    use super::*;

    fn grid(width: usize, height: usize) -> Grid {
        Grid {
            resolution_m: 0.1,
            corner: [0, 0],
            width,
            height,
            cells: vec![Cell::Unknown; width * height],
        }
    }

    proptest! {
        #[test]
        fn the_rectangles_have_every_difference(
            width in 1_usize..40,
            height in 1_usize..40,
            changed in proptest::collection::vec(any::<proptest::sample::Index>(), 0..12),
        ) {
            let before = grid(width, height);
            let mut after = before.clone();
            for index in &changed {
                let i = index.index(after.cells.len());
                after.cells[i] = Cell::Free;
            }
            let parts = rectangles(&before, &after);
            prop_assert!(parts.len() <= 4);
            prop_assert_eq!(parts.is_empty(), changed.is_empty());
            let mut built = before;
            for part in &parts {
                for row in part.rows(&after) {
                    built.cells[row.clone()].copy_from_slice(&after.cells[row]);
                }
            }
            prop_assert_eq!(built, after);
        }
    }

    #[test]
    fn distant_changes_are_several_rectangles() {
        let before = grid(100, 100);
        let mut after = before.clone();
        after.cells[0] = Cell::Free;
        after.cells[9_999] = Cell::Occupied;
        let parts = rectangles(&before, &after);
        assert_eq!(
            parts
                .iter()
                .map(|part| part.width * part.height)
                .sum::<usize>(),
            2
        );
    }
}
