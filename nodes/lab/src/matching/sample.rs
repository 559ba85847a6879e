//! Fewer points of a scan, spread evenly: one of each cell.

use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice};
use nalgebra::Isometry3;

/// Limit of points of a scan.
pub const MAX_POINTS: usize = u32::MAX as usize;

/// Draws one point (metres) of each occupied cell, at most `most`, in the order of the cells.
///
/// The point of a cell, and the cells if there are too many, are drawn by `round`: another round is another sample.
/// Points without a cell, and those beyond [`MAX_POINTS`], are ignored.
pub fn sample(points_m: &[[f32; 3]], lattice: &Lattice, most: usize, round: u64) -> Vec<[f32; 3]> {
    let quantizer = BatchQuantizer::new(lattice, Isometry3::identity());
    let mut drawn: Vec<(BlockKey, u64)> = Vec::with_capacity(points_m.len().min(MAX_POINTS));
    let mut index = 0_u64;
    quantizer.for_blocks(points_m, |codes, _| {
        for &code in codes {
            if code != BlockKey::NONE && index <= u64::from(u32::MAX) {
                drawn.push((code, mix(index, round) << 32 | index));
            }
            index += 1;
        }
    });
    drawn.sort_unstable();
    drawn.dedup_by_key(|(code, _)| *code);
    if drawn.len() > most {
        let lot = |(code, _): &(BlockKey, u64)| (mix(code.raw(), round), *code);
        drawn.select_nth_unstable_by_key(most, lot);
        drawn.truncate(most);
        drawn.sort_unstable();
    }
    let point = |(_, drawn): &(BlockKey, u64)| points_m.get(*drawn as u32 as usize).copied();
    drawn.iter().filter_map(point).collect()
}

/// Pseudo-random number (the finalizer of splitmix64).
fn mix(number: u64, round: u64) -> u64 {
    let mut z = number.wrapping_add(round.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn cell(lattice: &Lattice, p: &[f32; 3]) -> Option<[i32; 3]> {
        lattice.quantize(&Vector3::from(p.map(f64::from)))
    }

    proptest! {
        #[test]
        fn every_cell_has_one_point_and_there_are_no_more_than_asked_for(
            kind in 0..6_usize,
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f32), 0..300),
            most in 1..60_usize,
            round in 0..5_u64,
        ) {
            let lattice = Lattice::new(LatticeKind::ALL[kind], 0.05).unwrap();
            let of = |points: &[[f32; 3]]| points.iter().map(|p| cell(&lattice, p).unwrap()).collect::<Vec<_>>();
            let occupied: BTreeSet<_> = of(&points).into_iter().collect();
            let all = sample(&points, &lattice, usize::MAX, round);
            prop_assert_eq!(all.len(), occupied.len());
            prop_assert_eq!(of(&all).into_iter().collect::<BTreeSet<_>>(), occupied);
            let some = sample(&points, &lattice, most, round);
            prop_assert_eq!(some.len(), all.len().min(most));
            prop_assert!(some.iter().all(|p| all.contains(p)));
        }
    }

    #[test]
    fn points_without_a_cell_are_left_out_and_rounds_differ() {
        let lattice = Lattice::new(LatticeKind::Fcc, 1e-3).unwrap();
        let hostile = [f32::NAN, f32::INFINITY, 1e30, 0.5].map(|x| [x; 3]);
        assert_eq!(sample(&hostile, &lattice, 10, 0), [[0.5; 3]]);
        assert!(sample(&[], &lattice, 10, 0).is_empty());
        let many: Vec<[f32; 3]> = (0..500).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
        let [first, second] = [0, 1].map(|round| sample(&many, &lattice, 20, round));
        assert_ne!(first, second);
    }
}
