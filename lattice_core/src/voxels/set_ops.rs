//! Merge of two sorted lists of cells in one pass.

use std::cmp::Ordering;

use crate::lattice::MortonKey;

/// Visits every key of either list once, in order: `Less` if only in `a`, `Greater` if only in `b`. Both must ascend
/// strictly.
pub fn walk(mut a: &[MortonKey], mut b: &[MortonKey], mut visit: impl FnMut(MortonKey, Ordering)) {
    while let ([first_a, rest_a @ ..], [first_b, rest_b @ ..]) = (a, b) {
        let side = first_a.cmp(first_b);
        visit(*first_a.min(first_b), side);
        if side.is_le() {
            a = rest_a;
        }
        if side.is_ge() {
            b = rest_b;
        }
    }
    a.iter().for_each(|&key| visit(key, Ordering::Less));
    b.iter().for_each(|&key| visit(key, Ordering::Greater));
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_key_is_visited_once_and_on_its_side(
            a in prop::collection::btree_set(0_u64..40, 0..30),
            b in prop::collection::btree_set(0_u64..40, 0..30),
        ) {
            let keys = |raws: &BTreeSet<u64>| -> Vec<MortonKey> {
                raws.iter().filter_map(|&raw| MortonKey::from_raw(raw)).collect()
            };
            let mut visited = Vec::new();
            walk(&keys(&a), &keys(&b), |key, side| visited.push((key.raw(), side)));
            let side = |raw: &u64| b.contains(raw).cmp(&a.contains(raw));
            let expected: Vec<_> = (&a | &b).iter().map(|raw| (*raw, side(raw))).collect();
            prop_assert_eq!(visited, expected);
        }
    }
}
