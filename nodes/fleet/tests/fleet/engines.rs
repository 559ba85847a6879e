//! Foreign engines on the same tables: DuckDB and Polars give the sums of the embedded one, and the recipes
//! of the documentation run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::fixture::{Recipe, from_environment, parts, run, text};
use crate::logs::Logs;

const COMPARE: &str = r#"
import sys
import duckdb, polars

tables = sys.argv[1]
columns = ["count", "sum_x", "sum_y", "sum_z"]
sums = ", ".join(f"SUM({name})::BIGINT" for name in columns)
cells = "ix, iy, iz"
own = duckdb.sql(f"SELECT {cells}, {', '.join(columns)}, first_ns, last_ns "
                 f"FROM '{tables}/merged/*/voxels.parquet' ORDER BY {cells}").fetchall()
duck = duckdb.sql(f"SELECT {cells}, {sums}, MIN(first_ns), MAX(last_ns) "
                  f"FROM '{tables}/parts/*/*/voxels.parquet' GROUP BY {cells} ORDER BY {cells}").fetchall()
assert own == duck, "DuckDB"
polar = (polars.scan_parquet(f"{tables}/parts/*/*/voxels.parquet", hive_partitioning=False)
         .group_by("ix", "iy", "iz")
         .agg(polars.sum(*columns), polars.min("first_ns"), polars.max("last_ns"))
         .sort("ix", "iy", "iz").collect(engine="streaming").rows())
assert own == polar, "Polars"
own = duckdb.sql(f"SELECT {cells}, label, n FROM '{tables}/merged/*/labels.parquet' ORDER BY ALL").fetchall()
duck = duckdb.sql(f"SELECT {cells}, label, SUM(n)::BIGINT FROM '{tables}/parts/*/*/labels.parquet' "
                  "GROUP BY ALL ORDER BY ALL").fetchall()
assert own == duck and len(own) > 1000, "labels"
"#;

#[test]
fn duckdb_and_polars_give_the_same_sums() {
    let Some(python) = from_environment("LATTICE_PYTHON") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let tables = tables(folder.path());
    python_runs(&python, COMPARE, &[text(&tables)]);
}

#[test]
fn the_recipes_of_the_documentation_run() {
    let Some(python) = from_environment("LATTICE_PYTHON") else {
        return;
    };
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/tables.md");
    let page = std::fs::read_to_string(page).unwrap();
    let recipes = page.split("```python\n").skip(1);
    let recipes: Vec<_> = recipes
        .filter_map(|rest| rest.split("```").next())
        .collect();
    assert!(recipes.len() >= 2, "{} recipes", recipes.len());
    for recipe in recipes {
        let of_logs = recipe.contains("\"logs\"");
        let needs_java = recipe.contains("pyspark");
        if needs_java && Command::new("java").arg("-version").output().is_err() {
            eprintln!("skipped: the recipe for Spark needs java");
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        let mut path = Vec::new();
        if of_logs {
            let Some(logs) = Logs::simulate(&folder.path().join("logs"), 2, "2", &[]) else {
                continue;
            };
            fs::copy(&logs.params, folder.path().join("params.yaml")).unwrap();
            // `lattice` finds the program that is tested on the PATH, unless one is beside it.
            path.extend(
                [
                    Path::new(env!("CARGO_BIN_EXE_lattice-fleet")),
                    &logs.lattice,
                ]
                .map(parent),
            );
        } else {
            tables(folder.path());
        }
        // They name folders of where they are.
        path.extend(std::env::split_paths(&std::env::var_os("PATH").unwrap()));
        let mut command = Command::new(&python);
        command.args(["-c", recipe]).current_dir(folder.path());
        // What Spark starts its workers with.
        command.env("PYSPARK_PYTHON", &python);
        command.env("PATH", std::env::join_paths(path).unwrap());
        succeeds(&mut command, recipe);
        if of_logs {
            assert_eq!(parts(&folder.path().join("tables")).len(), 2);
        }
    }
}

fn parent(path: &Path) -> PathBuf {
    path.parent().unwrap().to_owned()
}

/// Tables of three maps, merged.
fn tables(folder: &Path) -> std::path::PathBuf {
    let tables = folder.join("tables");
    for seed in 0..3 {
        run([
            "to-table",
            text(&Recipe::new(seed).write(folder)),
            "-o",
            text(&tables),
        ]);
    }
    run(["merge", text(&tables)]);
    tables
}

fn python_runs(python: &Path, script: &str, arguments: &[&str]) {
    let mut command = Command::new(python);
    command.args(["-c", script]).args(arguments);
    succeeds(&mut command, script);
}

fn succeeds(command: &mut Command, script: &str) {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}\n{script}");
}
