//! Tiles against maps and sets of the standard library.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;

use super::super::tiles::{Column, ColumnSet, Tiles};

fn column() -> impl Strategy<Value = Column> {
    // Across the corner of four tiles, and on both sides of 0.
    [-20..20_i32, -20..20_i32]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn values_are_those_that_were_set(
        steps in proptest::collection::vec((column(), any::<Option<u8>>()), 0..120),
        center in column(),
        reach in 0..12_i32,
    ) {
        let (mut tiles, mut expected) = (Tiles::default(), BTreeMap::new());
        for (column, value) in steps {
            tiles.set(column, value);
            match value {
                Some(value) => drop(expected.insert(column, value)),
                None => drop(expected.remove(&column)),
            }
            prop_assert_eq!(tiles.get(column), expected.get(&column));
            prop_assert_eq!(tiles.is_empty(), expected.is_empty());
        }
        let all: BTreeMap<Column, u8> = tiles.iter().map(|(at, value)| (at, *value)).collect();
        prop_assert_eq!(&all, &expected);
        let mut inside = Vec::new();
        tiles.for_square(center, reach, |value| inside.push(*value));
        let is_inside = |at: &Column| (0..2).all(|axis| at[axis].abs_diff(center[axis]) <= reach as u32);
        let mut wanted: Vec<u8> = expected.iter().filter(|(at, _)| is_inside(at)).map(|(_, value)| *value).collect();
        inside.sort_unstable();
        wanted.sort_unstable();
        prop_assert_eq!(inside, wanted);
    }

    #[test]
    fn sets_grow_by_their_reach(
        columns in proptest::collection::btree_set(column(), 0..20),
        reach in 0..12_i32,
    ) {
        let mut set = ColumnSet::default();
        columns.iter().for_each(|column| set.insert(*column));
        let beside = |[x, y]: &Column| {
            let (x, y) = (*x, *y);
            (-reach..=reach).flat_map(move |dx| (-reach..=reach).map(move |dy| [x + dx, y + dy])).collect::<Vec<_>>()
        };
        let expected: BTreeSet<Column> = columns.iter().flat_map(beside).collect();
        let rows = set.around(reach).rows();
        let found: BTreeSet<Column> = rows.values().flatten().copied().collect();
        prop_assert_eq!(rows.values().map(Vec::len).sum::<usize>(), found.len(), "each once");
        prop_assert_eq!(found, expected);
        // Columns within the reach of a row are in rows of tiles that are near.
        let within = ColumnSet::rows_within(reach);
        for (row, columns) in rows {
            for [x, y] in columns {
                let mut beyond = ColumnSet::default();
                [-reach, reach].iter().for_each(|dy| beyond.insert([x, y + dy]));
                prop_assert!(beyond.rows().keys().all(|other| row.abs_diff(*other) <= within as u32));
            }
        }
    }
}
