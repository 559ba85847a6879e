//! Maps that cannot be merged are refused before any work, with their values.

use std::fs;

use lattice_core::lattice::LatticeKind;

use crate::fixture::{Recipe, parts, refused, run, sealed_again, text};

#[test]
fn maps_of_other_cells_are_refused() {
    let others = [
        (LatticeKind::Bcc, 0.05, true, "bcc cells"),
        (LatticeKind::Fcc, 0.06, true, "0.06 m^3"),
        (LatticeKind::Fcc, 0.05, false, "without labels"),
    ];
    for (kind, volume_m3, labels, expected) in others {
        let folder = tempfile::tempdir().unwrap();
        let tables = folder.path().join("tables");
        let other = Recipe {
            kind,
            volume_m3,
            labels,
            ..Recipe::new(2)
        };
        for recipe in [Recipe::new(1), other] {
            run([
                "to-table",
                text(&recipe.write(folder.path())),
                "-o",
                text(&tables),
            ]);
        }
        let said = refused(["merge", text(&tables)]);
        assert!(
            said.contains("cannot be merged") && said.contains(expected),
            "{said}"
        );
        assert!(!tables.join("merged").exists());
    }
}

#[test]
fn maps_of_other_origins_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    for (seed, latitude) in [(1, "-27.5"), (2, "-27.6")] {
        let map = Recipe::new(seed).write(folder.path());
        let origin = ["--origin", latitude, "152.9", "80"];
        run(["to-table", text(&map), "-o", text(&tables)]
            .into_iter()
            .chain(origin));
    }
    let said = refused(["merge", text(&tables)]);
    assert!(
        said.contains("origin [-27.5") && said.contains("origin [-27.6"),
        "{said}"
    );
}

#[test]
fn tampered_and_foreign_folders_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    let said = refused(["merge", text(&tables)]);
    assert!(said.contains("no folder of tables"), "{said}");
    run([
        "to-table",
        text(&Recipe::new(1).write(folder.path())),
        "-o",
        text(&tables),
    ]);
    let file = parts(&tables)[0].join("part.json");
    let good = fs::read_to_string(&file).unwrap();
    for (from, to, expected) in [
        ("\"version\": 3", "\"version\": 7", "version 7"),
        (
            "0.05",
            "0.0500001",
            "is not that of Lattice(fcc, 0.0500001 m^3)",
        ),
        ("\"kind\": \"map\"", "\"kind\": \"log\"", "names it"),
        ("\"tiles\"", "\"tails\"", "unknown field"),
    ] {
        fs::write(&file, sealed_again(&good.replacen(from, to, 1))).unwrap();
        let said = refused([
            "merge",
            text(&tables),
            "--map-out",
            text(&folder.path().join("out.lat")),
        ]);
        assert!(said.contains(expected), "{expected}: {said}");
    }
    fs::write(&file, r#"{"version": 1, "tiles": []}"#).unwrap();
    let said = refused(["merge", text(&tables)]);
    assert!(said.contains("version 1 of the tables, not 3"), "{said}");
    fs::write(&file, good).unwrap();
    run(["merge", text(&tables)]);
    let said = refused([
        "from-table",
        text(folder.path()),
        "-o",
        text(&folder.path().join("out.lat")),
    ]);
    assert!(said.contains("no folder of tables"), "{said}");
    let said = refused(["merge", text(&tables), "--engine", "spark"]);
    assert!(said.contains("ballista://HOST:PORT"), "{said}");
}
