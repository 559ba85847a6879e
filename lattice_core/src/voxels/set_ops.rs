//! Sets of cells as sorted keys, each operation in one pass.

use std::cmp::Ordering;

use crate::lattice::MortonKey;

/// The keys of either list. Both must ascend strictly; so does the result.
pub fn union(a: &[MortonKey], b: &[MortonKey]) -> Vec<MortonKey> {
    let mut keys = Vec::with_capacity(a.len().max(b.len()));
    walk(a, b, |key, _| keys.push(key));
    keys
}

/// The keys of both lists. Both must ascend strictly; so does the result.
pub fn intersection(a: &[MortonKey], b: &[MortonKey]) -> Vec<MortonKey> {
    let mut keys = Vec::new();
    walk(a, b, |key, side| {
        if side.is_eq() {
            keys.push(key);
        }
    });
    keys
}

/// The keys of `a` that are not in `b`. Both must ascend strictly; so does the result.
pub fn difference(a: &[MortonKey], b: &[MortonKey]) -> Vec<MortonKey> {
    let mut keys = Vec::new();
    walk(a, b, |key, side| {
        if side.is_lt() {
            keys.push(key);
        }
    });
    keys
}

/// Visits every key of either list once, in order: `Less` if only in `a`, `Greater` if only in `b`.
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

    fn keys(raws: &BTreeSet<u64>) -> Vec<MortonKey> {
        raws.iter()
            .filter_map(|&raw| MortonKey::from_raw(raw))
            .collect()
    }

    proptest! {
        #[test]
        fn as_sets_do(
            a in prop::collection::btree_set(0_u64..40, 0..30),
            b in prop::collection::btree_set(0_u64..40, 0..30),
        ) {
            let (ours, theirs) = (keys(&a), keys(&b));
            let set = |keys: Vec<MortonKey>| {
                assert!(keys.is_sorted_by(|a, b| a < b));
                keys.into_iter().map(MortonKey::raw).collect::<BTreeSet<u64>>()
            };
            prop_assert_eq!(set(union(&ours, &theirs)), &a | &b);
            prop_assert_eq!(set(intersection(&ours, &theirs)), &a & &b);
            prop_assert_eq!(set(difference(&ours, &theirs)), &a - &b);
        }
    }
}
