//! Counts beyond what a map file holds.

use std::fs;

use lattice_core::voxels::file::{MapColumns, MapContents};

use crate::fixture::{Recipe, run, text, write_map};

/// A map of one cell that holds 2^32 - 2 points at its border.
fn crowded() -> MapContents {
    let recipe = Recipe {
        volume_m3: 1.0,
        labels: false,
        ..Recipe::new(1)
    };
    let mut columns = MapColumns::from(recipe.map());
    let reach = MapColumns::offset_reach(&columns.lattice) as i64;
    let count = u32::MAX - 1;
    columns.keys.truncate(1);
    columns
        .stamps
        .iter_mut()
        .for_each(|stamps| stamps.truncate(1));
    if let Some(voxels) = &mut columns.voxels {
        voxels.truncate(1);
        voxels[0].count = count;
        voxels[0].sum = [i64::from(count) * (reach / 2), 0, 0];
    }
    columns.statistics.points = count.into();
    columns.statistics.squares = u128::from(columns.statistics.largest_square);
    columns.statistics.distances = 0;
    columns.try_into().unwrap()
}

#[test]
fn counts_grow_beyond_32_bits_in_tables_and_stay_there_in_a_map_file() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    for seed in 0..2 {
        let path = folder.path().join(format!("{seed}.lat"));
        // Other statistics, another map.
        let mut columns = MapColumns::from(crowded());
        columns.statistics.points += seed;
        write_map(&columns.try_into().unwrap(), &path);
        run(["to-table", text(&path), "-o", text(&tables)]);
    }
    let out = folder.path().join("out.lat");
    run(["merge", text(&tables), "--map-out", text(&out)]);
    let map = MapContents::read(&fs::read(&out).unwrap()[..], 10).unwrap();
    assert_eq!(map.voxels().unwrap()[0].count, u32::MAX);
}
