//! Parts that are damaged, manifests that lie, merges that are killed: nothing counts twice, the bad part is named.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::fixture::{
    Recipe, fleet, json as figures, merged, parts, program, refused, run, sealed_again, text,
};

/// Tables of some maps below a folder, and the map file of all.
fn tables(folder: &Path, maps: u64) -> (PathBuf, Vec<u8>) {
    let tables = folder.join("tables");
    let recipes: Vec<_> = (0..maps).map(Recipe::new).collect();
    for recipe in &recipes {
        run(["to-table", text(&recipe.write(folder)), "-o", text(&tables)]);
    }
    (tables, merged(recipes.iter().map(Recipe::map)))
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files.extend(files_below(&path)),
            false => files.push(path),
        }
    }
    files.sort();
    files
}

#[test]
fn flips_and_cuts_are_named_and_count_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (tables, expected) = tables(folder.path(), 3);
    let files = files_below(&tables.join("parts"));
    let (fresh, out) = (folder.path().join("fresh"), folder.path().join("out.lat"));
    let merge = [
        "merge",
        text(&tables),
        "--out",
        text(&fresh),
        "--map-out",
        text(&out),
    ];
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for turn in 0..200 {
        let file = &files[random.random_range(0..files.len())];
        let good = fs::read(file).unwrap();
        let mut bad = good.clone();
        let place = random.random_range(0..bad.len());
        match turn % 4 {
            0 => bad.truncate(place),
            1 => bad.push(0),
            _ => bad[place] ^= 1 << random.random_range(0..8),
        }
        fs::write(file, &bad).unwrap();
        let said = refused(merge);
        let part = parts(&tables)
            .into_iter()
            .find(|part| file.starts_with(part))
            .unwrap();
        assert!(
            said.contains(text(&part)),
            "turn {turn}, {}: {said}",
            file.display()
        );
        assert!(!out.exists(), "turn {turn}");
        let output = fleet(["status", text(&tables), "--verify"]);
        assert!(!output.status.success(), "turn {turn}, {}", file.display());
        fs::write(file, &good).unwrap();
    }
    // What was merged between them goes on once all are whole.
    run(merge);
    assert_eq!(fs::read(&out).unwrap(), expected);
}

#[test]
fn a_damaged_merged_map_is_named_or_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let (tables, expected) = tables(folder.path(), 2);
    let out = folder.path().join("out.lat");
    run(["merge", text(&tables)]);
    let files = files_below(&tables.join("merged"));
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for file in files.iter().cycle().take(40) {
        let good = fs::read(file).unwrap();
        let mut bad = good.clone();
        let place = random.random_range(0..bad.len());
        bad[place] ^= 1 << random.random_range(0..8);
        fs::write(file, &bad).unwrap();
        let output = fleet(["merge", text(&tables), "--map-out", text(&out)]);
        if output.status.success() {
            assert_eq!(fs::read(&out).unwrap(), expected, "{}", file.display());
        } else {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(said.contains("merged.json"), "{}: {said}", file.display());
        }
        fs::write(file, &good).unwrap();
    }
}

#[test]
fn manifests_that_lie_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let (tables, expected) = tables(folder.path(), 2);
    let file = parts(&tables)[0].join("part.json");
    let good = fs::read_to_string(&file).unwrap();
    type Lie = fn(&mut Value);
    let lies: [(&str, Lie); 9] = [
        ("must be unique and ascend", |part| {
            let tile = part["tiles"][0].clone();
            part["tiles"].as_array_mut().unwrap().insert(0, tile);
        }),
        ("must be unique and ascend", |part| {
            part["tiles"].as_array_mut().unwrap().reverse();
        }),
        ("its manifest promises", |part| {
            part["tiles"][0]["rows"] = json!(7)
        }),
        ("a tile has 1..=", |part| {
            part["tiles"][0]["rows"] = json!(u64::MAX)
        }),
        ("a tile has 1..=", |part| {
            part["tiles"][0]["rows"] = json!(0)
        }),
        ("its manifest promises", |part| {
            part["tiles"][0]["label_rows"] = json!(1)
        }),
        ("its manifest promises at most", |part| {
            let count = part["tiles"][0]["max_count"].as_i64().unwrap();
            part["tiles"][0]["max_count"] = json!(count + 1)
        }),
        ("whether there are labels", |part| {
            part["tiles"][0]["labels"] = Value::Null
        }),
        ("No such file", |part| {
            let tile = part["tiles"][0]["tile"].as_i64().unwrap();
            part["tiles"][0]["tile"] = json!(tile - 1);
        }),
    ];
    let fresh = folder.path().join("fresh");
    for (expected, lie) in lies {
        let mut part = figures(&good);
        lie(&mut part);
        let text_of = serde_json::to_string_pretty(&part).unwrap();
        fs::write(&file, sealed_again(&text_of)).unwrap();
        let output = fleet(["merge", text(&tables), "--out", text(&fresh)]);
        let said = String::from_utf8_lossy(&output.stderr);
        let named = said.contains(expected) && said.contains(text(file.parent().unwrap()));
        assert!(!output.status.success() && named, "{expected}: {said}");
    }
    // Rows of one tile under the name of another.
    let mut part = figures(&good);
    let tiles: Vec<i64> = part["tiles"]
        .as_array()
        .unwrap()
        .iter()
        .map(|t| t["tile"].as_i64().unwrap())
        .collect();
    let free = (0..)
        .find(|tile| !tiles.contains(tile) && *tile < tiles[0])
        .unwrap();
    let of = |tile: i64| file.with_file_name(format!("tile={tile}"));
    fs::rename(of(tiles[0]), of(free)).unwrap();
    part["tiles"][0]["tile"] = json!(free);
    let text_of = serde_json::to_string_pretty(&part).unwrap();
    fs::write(&file, sealed_again(&text_of)).unwrap();
    let said = refused(["merge", text(&tables), "--out", text(&fresh)]);
    assert!(said.contains("rows of other tiles"), "{said}");
    fs::rename(of(free), of(tiles[0])).unwrap();
    fs::write(&file, &good).unwrap();
    let out = folder.path().join("out.lat");
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

#[test]
fn merges_that_are_killed_go_on_and_count_once() {
    let folder = tempfile::tempdir().unwrap();
    let (tables, expected) = tables(folder.path(), 4);
    let out = folder.path().join("out.lat");
    let merge = ["merge", text(&tables), "--rows-at-once", "1"];
    for kill in 0..20 {
        let mut running = program().args(merge).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(7 * kill));
        let _ = running.kill();
        running.wait().unwrap();
        // A part that comes between two of them.
        if kill == 10 {
            let more = Recipe::new(9).write(folder.path());
            run(["to-table", text(&more), "-o", text(&tables)]);
        }
    }
    let part = parts(&tables);
    assert_eq!(part.len(), 5);
    run(["merge", text(&tables), "--map-out", text(&out)]);
    let all = (0..4).chain([9]).map(|seed| Recipe::new(seed).map());
    assert_eq!(fs::read(&out).unwrap(), merged(all));
    assert_ne!(fs::read(&out).unwrap(), expected);
}
