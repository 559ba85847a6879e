//! Folders whose names are patterns, escapes or not ASCII: paths are literal.

use std::fs;
use std::path::Path;

use crate::fixture::{Recipe, merged, run, text};

/// Names of folders, each with neighbours that it would match as a pattern.
pub const NAMES: [&str; 9] = [
    "a[1]b",
    "a*b",
    "a?b",
    "a{1,2}b",
    "with space",
    "50%",
    "%20",
    "a#b",
    "Gr\u{f6}\u{df}e \u{5730}\u{56f3}",
];

/// Tables of two maps in a folder of that name, the map file of both, and tables of another map beside them.
pub fn tables(folder: &Path, name: &str) -> (std::path::PathBuf, Vec<u8>) {
    let tables = folder.join(name);
    let recipes = [Recipe::new(1), Recipe::new(2)];
    for recipe in &recipes {
        run(["to-table", text(&recipe.write(folder)), "-o", text(&tables)]);
    }
    let other = Recipe::new(3).write(folder);
    for neighbour in ["a1b", "a2b"] {
        run([
            "to-table",
            text(&other),
            "-o",
            text(&folder.join(neighbour)),
        ]);
    }
    (tables, merged(recipes.iter().map(Recipe::map)))
}

#[test]
fn names_that_are_patterns_or_escapes_are_literal() {
    for name in NAMES {
        let folder = tempfile::tempdir().unwrap();
        let (tables, expected) = tables(folder.path(), name);
        let out = folder.path().join("out.lat");
        run(["merge", text(&tables), "--map-out", text(&out)]);
        assert_eq!(fs::read(&out).unwrap(), expected, "{name}");
        run(["status", text(&tables), "--verify"]);
        // The folder of the merged map too.
        let merged = folder.path().join(format!("merged {name}"));
        let places = ["merge", text(&tables), "--out", text(&merged)];
        run(places.into_iter().chain(["--map-out", text(&out)]));
        run(["from-table", text(&merged), "-o", text(&out)]);
        assert_eq!(fs::read(&out).unwrap(), expected, "{name}");
    }
}
