//! Points gathered by cell before they reach the table.

use super::fixed::Point;
use crate::lattice::CellCode;

const SLOTS_LOG2: u32 = 13;
const SLOTS: usize = 1 << SLOTS_LOG2;

/// Points of one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Partial {
    pub(super) code: CellCode,
    pub(super) points: Point,
}

const EMPTY: Partial = Partial {
    code: CellCode::NONE,
    points: [0; 4],
};

/// The cells that are being filled, as many as fit a direct-mapped table near the processor.
///
/// Neighbouring beams and successive scans fill the same cells: most points end here, and the large
/// table sees a cell once for many points.
#[derive(Clone, Debug)]
pub(super) struct Gather {
    slots: Vec<Partial>,
    used: Vec<u16>,
}

impl Gather {
    pub(super) fn new() -> Gather {
        Gather {
            slots: vec![EMPTY; SLOTS],
            used: Vec::with_capacity(SLOTS),
        }
    }

    /// Adds points in order, each as its number's `point`; a cell that has to make room for another
    /// goes to `out`, as does one with `most_points`, but not what has no cell.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        codes: &[CellCode],
        point: impl Fn(usize) -> Point,
        most_points: u32,
        out: &mut Vec<Partial>,
    ) {
        let Some(slots) = self.slots.first_chunk_mut::<SLOTS>() else {
            return;
        };
        for (i, &code) in codes.iter().enumerate() {
            let hash = code.raw().wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let number = (hash >> (64 - SLOTS_LOG2)) as usize;
            let slot = &mut slots[number];
            if slot.code != code || slot.points[3] >= most_points {
                if slot.code == CellCode::NONE {
                    self.used.push(number as u16);
                } else {
                    out.push(*slot);
                }
                *slot = Partial {
                    code,
                    points: [0; 4],
                };
            }
            for (sum, term) in slot.points.iter_mut().zip(point(i)) {
                *sum = sum.wrapping_add(term);
            }
        }
    }

    /// Moves all cells to `out`. Points without a cell are left out.
    pub(super) fn drain(&mut self, out: &mut Vec<Partial>) {
        for number in self.used.drain(..) {
            if let Some(slot) = self.slots.get_mut(usize::from(number)) {
                if slot.code != CellCode::NONE {
                    out.push(*slot);
                }
                *slot = EMPTY;
            }
        }
    }
}
