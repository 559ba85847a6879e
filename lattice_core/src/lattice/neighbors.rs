//! Neighbouring cells as lattice index differences.
//!
//! Ryde & Brünig eq. (3)-(7), corrected: eq. (7) lacks the pair ±(1,1,1). The FCC cell touches six more cells in a
//! vertex than eq. (4) lists; its 12 are only the face neighbours.

use super::{LatticeIndex, LatticeKind};

/// Expands one vector of each pair to both.
const fn pairs<const N: usize, const M: usize>(half: [LatticeIndex; N]) -> [LatticeIndex; M] {
    assert!(2 * N == M);
    let mut all = [[0; 3]; M];
    let mut i = 0;
    while i < N {
        let [a, b, c] = half[i];
        all[2 * i] = [a, b, c];
        all[2 * i + 1] = [-a, -b, -c];
        i += 1;
    }
    all
}

// Face neighbours first, then those that share only an edge or a vertex.

static CUBIC: [LatticeIndex; 26] = pairs([
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
    [1, 1, 1],
    [1, 1, -1],
    [1, -1, 1],
    [1, -1, -1],
]);

static BCC: [LatticeIndex; 14] = pairs([
    [0, 0, 1],
    [1, 0, -1],
    [0, 1, -1],
    [1, 1, -1],
    [1, 0, 0],
    [0, 1, 0],
    [1, 1, -2],
]);

static FCC: [LatticeIndex; 18] = pairs([
    [0, 1, 0],
    [0, 0, 1],
    [0, 1, 1],
    [1, -1, 0],
    [1, -1, -1],
    [1, -2, -1],
    [1, 0, 0],
    [1, -2, 0],
    [1, -2, -2],
]);

static MCC: [LatticeIndex; 14] = pairs([
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 1],
    [1, 1, 0],
    [0, 1, 1],
    [1, 0, 1],
]);

static HEX: [LatticeIndex; 20] = pairs([
    [0, 0, 1],
    [1, 0, 0],
    [0, 1, 0],
    [1, 1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
    [1, 1, 1],
    [1, 1, -1],
]);

/// All touching cells, face neighbours first; empty for `Custom`.
pub(super) fn touching(kind: LatticeKind) -> &'static [LatticeIndex] {
    match kind {
        LatticeKind::Cubic => &CUBIC,
        LatticeKind::Bcc => &BCC,
        LatticeKind::Fcc => &FCC,
        LatticeKind::Mcc => &MCC,
        LatticeKind::Hex | LatticeKind::HexOptimal => &HEX,
        LatticeKind::Custom => &[],
    }
}

/// Face neighbours: the Voronoi-relevant vectors; empty for `Custom`.
pub(super) fn faces(kind: LatticeKind) -> &'static [LatticeIndex] {
    match kind {
        LatticeKind::Cubic => &CUBIC[..6],
        LatticeKind::Bcc => &BCC,
        LatticeKind::Fcc => &FCC[..12],
        LatticeKind::Mcc => &MCC,
        LatticeKind::Hex | LatticeKind::HexOptimal => &HEX[..8],
        LatticeKind::Custom => &[],
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use nalgebra::Vector3;

    use super::*;
    use crate::lattice::generator::unit_generator;

    /// All lattice vectors that are shortest in their class modulo 2 L, by that class.
    fn shortest_of_each_class(kind: LatticeKind) -> Vec<Vec<LatticeIndex>> {
        let g = unit_generator(kind);
        let mut classes: BTreeMap<[i32; 3], Vec<(f64, LatticeIndex)>> = BTreeMap::new();
        for code in 0..11 * 11 * 11 {
            let w = [code % 11 - 5, code / 11 % 11 - 5, code / 121 - 5];
            let length = (g * Vector3::from(w.map(f64::from))).norm();
            classes
                .entry(w.map(|i: i32| i.rem_euclid(2)))
                .or_default()
                .push((length, w));
        }
        assert!(classes.remove(&[0; 3]).is_some());
        let shortest = |members: &Vec<(f64, LatticeIndex)>| {
            let least = members.iter().map(|m| m.0).fold(f64::MAX, f64::min);
            let nearest = members.iter().filter(|m| m.0 < least + 1e-9);
            nearest.map(|m| m.1).collect()
        };
        classes.values().map(shortest).collect()
    }

    #[test]
    fn tables_are_the_vectors_of_voronoi_theory() {
        for (kind, faces_expected, touching_expected) in [
            (LatticeKind::Cubic, 6, 26),
            (LatticeKind::Bcc, 14, 14),
            (LatticeKind::Fcc, 12, 18),
            (LatticeKind::Mcc, 14, 14),
            (LatticeKind::Hex, 8, 20),
            (LatticeKind::HexOptimal, 8, 20),
        ] {
            let classes = shortest_of_each_class(kind);
            let pairs = classes.iter().filter(|c| c.len() == 2).flatten();
            let relevant: BTreeSet<_> = pairs.copied().collect();
            let all: BTreeSet<_> = classes.iter().flatten().copied().collect();
            let set = |table: &[LatticeIndex]| table.iter().copied().collect::<BTreeSet<_>>();
            assert_eq!(set(faces(kind)), relevant, "{kind}");
            assert_eq!(set(touching(kind)), all, "{kind}");
            let counts = (faces(kind).len(), touching(kind).len());
            assert_eq!(counts, (faces_expected, touching_expected));
            assert!(touching(kind).starts_with(faces(kind)));
        }
    }

    #[test]
    fn distances_are_those_of_the_theory() {
        let check = |kind, expected: &[(u64, usize)]| {
            let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
            for w in touching(kind) {
                let length = (unit_generator(kind) * Vector3::from(w.map(f64::from))).norm();
                *counts.entry((length * 1e5).round() as u64).or_default() += 1;
            }
            assert!(counts.into_iter().eq(expected.iter().copied()), "{kind}");
        };
        use LatticeKind::{Bcc, Cubic, Fcc, Hex, Mcc};
        check(Cubic, &[(100_000, 6), (141_421, 12), (173_205, 8)]);
        check(Bcc, &[(109_112, 8), (125_992, 6)]);
        check(Fcc, &[(112_246, 12), (158_740, 6)]);
        check(Mcc, &[(109_868, 8), (118_921, 4), (141_421, 2)]);
        check(Hex, &[(83_268, 2), (117_759, 6), (144_225, 12)]);
    }
}
