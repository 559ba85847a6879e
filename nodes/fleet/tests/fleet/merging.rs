//! One map of many: the same bytes in any order and grouping, and only what changed is made again.

use std::fs;

use crate::fixture::{Recipe, json, merged, parts, program, run, some_table, text};

#[test]
fn a_map_goes_through_tables_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for (number, labels) in [true, false].into_iter().enumerate() {
        let recipe = Recipe {
            datum_m: [40.0, -3.0, 0.7],
            labels,
            ..Recipe::new(number as u64)
        };
        let map = recipe.write(folder.path());
        let tables = folder.path().join(format!("tables{number}"));
        let back = folder.path().join("back.lat");
        run(["to-table", text(&map), "-o", text(&tables)]);
        run(["from-table", text(&tables), "-o", text(&back)]);
        assert_eq!(fs::read(&map).unwrap(), fs::read(&back).unwrap());
    }
}

#[test]
fn occupied_cells_alone_go_through_tables_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut maps: Vec<_> = (0..2).map(|seed| Recipe::new(seed).map()).collect();
    maps.iter_mut().for_each(|map| map.drop_payload());
    let tables = folder.path().join("tables");
    for (number, map) in maps.iter().enumerate() {
        let path = folder.path().join(format!("{number}.lat"));
        crate::fixture::write_map(map, &path);
        run(["to-table", text(&path), "-o", text(&tables)]);
    }
    let out = folder.path().join("out.lat");
    run(["merge", text(&tables), "--map-out", text(&out)]);
    assert_eq!(fs::read(&out).unwrap(), merged(maps));
}

#[test]
fn order_grouping_and_threads_do_not_change_a_byte() {
    let folder = tempfile::tempdir().unwrap();
    let recipes: Vec<_> = (0..5).map(Recipe::new).collect();
    let maps: Vec<_> = recipes
        .iter()
        .map(|recipe| recipe.write(folder.path()))
        .collect();
    let expected = merged(recipes.iter().map(Recipe::map));
    let out = folder.path().join("out.lat");
    let orders: [&[usize]; 3] = [&[0, 1, 2, 3, 4], &[4, 2, 0, 3, 1], &[3, 3, 4, 0, 1, 2, 1]];
    for (number, order) in orders.into_iter().enumerate() {
        let tables = folder.path().join(format!("tables{number}"));
        for map in order {
            run(["to-table", text(&maps[*map]), "-o", text(&tables)]);
        }
        assert_eq!(parts(&tables).len(), 5);
        for (threads, rows) in [("1", "4000000"), ("2", "1")] {
            let merged = folder.path().join(format!("merged{number}-{threads}"));
            let options = ["--threads", threads, "--rows-at-once", rows];
            let places = [
                "merge",
                text(&tables),
                "--out",
                text(&merged),
                "--map-out",
                text(&out),
            ];
            run(places.into_iter().chain(options));
            assert_eq!(
                fs::read(&out).unwrap(),
                expected,
                "{number}, {threads} threads"
            );
        }
    }
    // Maps of maps: groups that were merged before are parts like any other.
    let (groups, tables) = ([&maps[..2], &maps[2..]], folder.path().join("groups"));
    for (number, group) in groups.into_iter().enumerate() {
        let of_group = folder.path().join(format!("group{number}"));
        let map = folder.path().join(format!("group{number}.lat"));
        let group = group.iter().map(|map| text(map));
        run(["to-table"]
            .into_iter()
            .chain(group)
            .chain(["-o", text(&of_group)]));
        run(["merge", text(&of_group), "--map-out", text(&map)]);
        run(["to-table", text(&map), "-o", text(&tables)]);
    }
    run(["merge", text(&tables), "--map-out", text(&out)]);
    assert_eq!(fs::read(&out).unwrap(), expected);
}

#[test]
fn maps_of_other_datums_are_rebased_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let datums_m = [[0.0; 3], [100.0, 20.0, 3.0], [-70.0, 5.0, 0.0]];
    let mut recipes: Vec<_> = (0..3).map(Recipe::new).collect();
    recipes
        .iter_mut()
        .zip(datums_m)
        .for_each(|(recipe, at)| recipe.datum_m = at);
    let tables = folder.path().join("tables");
    for recipe in &recipes {
        run([
            "to-table",
            text(&recipe.write(folder.path())),
            "-o",
            text(&tables),
        ]);
    }
    let out = folder.path().join("out.lat");
    run(["merge", text(&tables), "--map-out", text(&out)]);
    // The least datum counts.
    recipes.sort_by_key(|recipe| recipe.map().datum_index());
    assert_eq!(
        fs::read(&out).unwrap(),
        merged(recipes.iter().map(Recipe::map))
    );
}

#[test]
fn only_the_tiles_of_new_parts_are_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    for seed in 0..3 {
        run([
            "to-table",
            text(&Recipe::new(seed).write(folder.path())),
            "-o",
            text(&tables),
        ]);
    }
    let merge = || json(&run(["merge", text(&tables), "--json"]));
    let first = merge();
    assert_eq!(first["tiles_kept"], 0);
    assert_eq!(merge()["tiles_kept"], first["tiles"]);
    // A map of one corner.
    let mut corner = Recipe::new(9).map();
    corner.retain(|_, center_m| center_m.x > 100.0 && center_m.y > 100.0);
    let path = folder.path().join("corner.lat");
    crate::fixture::write_map(&corner, &path);
    run(["to-table", text(&path), "-o", text(&tables)]);
    let later = merge();
    let made = later["tiles"].as_u64().unwrap() - later["tiles_kept"].as_u64().unwrap();
    assert!(
        made > 0 && made < later["tiles"].as_u64().unwrap() / 2,
        "{later}"
    );
    // Without the part its tiles are as they were.
    let whole = fs::read(tables.join("merged/merged.json")).unwrap();
    run([
        "merge",
        text(&tables),
        "--out",
        text(&folder.path().join("fresh")),
    ]);
    assert_eq!(
        whole,
        fs::read(folder.path().join("fresh/merged.json")).unwrap()
    );
}

#[test]
fn what_was_not_finished_counts_nothing_and_what_is_damaged_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    let recipes: Vec<_> = (0..3).map(Recipe::new).collect();
    for recipe in &recipes {
        run([
            "to-table",
            text(&recipe.write(folder.path())),
            "-o",
            text(&tables),
        ]);
    }
    let expected = merged(recipes.iter().map(Recipe::map));
    // A task that was killed leaves half a part beside, and a copy of a whole one.
    let half = tables.join("tmp/0123-half/tile=7");
    fs::create_dir_all(&half).unwrap();
    fs::copy(some_table(&tables), half.join("voxels.parquet")).unwrap();
    let out = folder.path().join("out.lat");
    run(["merge", text(&tables), "--map-out", text(&out)]);
    assert_eq!(fs::read(&out).unwrap(), expected);
    assert_eq!(
        json(&run(["status", text(&tables), "--json"]))["unfinished"],
        1
    );
    // A damaged table of the same length.
    let table = some_table(&tables);
    let mut bytes = fs::read(&table).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&table, &bytes).unwrap();
    run(["status", text(&tables)]);
    let fresh = folder.path().join("fresh");
    for arguments in [
        ["status", text(&tables), "--verify", "--json"],
        ["merge", text(&tables), "--out", text(&fresh)],
    ] {
        let output = program().args(arguments).output().unwrap();
        assert!(!output.status.success());
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            said.contains("damaged") && said.contains(text(&table)),
            "{said}"
        );
    }
    // A merge that was stopped there goes on once the table is whole again.
    bytes[middle] ^= 1;
    fs::write(&table, &bytes).unwrap();
    run([
        "merge",
        text(&tables),
        "--out",
        text(&fresh),
        "--map-out",
        text(&out),
    ]);
    assert_eq!(fs::read(&out).unwrap(), expected);
}
