//! The map stage over simulated logs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::fixture::{from_environment, json, refused, run, text};

/// The program, parameters with a fixed origin, and some logs.
pub struct Logs {
    pub lattice: PathBuf,
    pub params: PathBuf,
    pub logs: Vec<PathBuf>,
}

impl Logs {
    /// Simulates logs below a folder with further options; none without the program.
    pub fn simulate(
        folder: &Path,
        count: usize,
        duration_s: &str,
        further: &[&str],
    ) -> Option<Logs> {
        let lattice = from_environment("LATTICE_PROGRAM")?;
        fs::create_dir_all(folder).unwrap();
        let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/bobcat.yaml");
        let log = |seed: usize| {
            let log = folder.join(format!("log{seed}"));
            let seed = seed.to_string();
            let options = ["--duration", duration_s, "--seed", &seed];
            let mut command = Command::new(&lattice);
            command
                .args(["simulate", "bobcat", "--out", text(&log)])
                .args(options)
                .args(further);
            let output = command.output().unwrap();
            assert!(
                output.status.success(),
                "{}",
                String::from_utf8_lossy(&output.stderr)
            );
            log
        };
        Some(Logs {
            logs: (1..=count).map(log).collect(),
            lattice,
            params,
        })
    }

    /// Arguments that map the logs.
    pub fn map<'a>(&'a self, tables: &'a Path, further: &[&'a str]) -> Vec<&'a str> {
        let mut arguments = vec!["map", "--json", "-o", text(tables)];
        arguments.extend([
            "--params",
            text(&self.params),
            "--program",
            text(&self.lattice),
        ]);
        arguments.extend(further);
        arguments.extend(self.logs.iter().map(|log| text(log)));
        arguments
    }

    /// The map file that `lattice replay` and `lattice map merge` make of the logs.
    pub fn expected(&self, folder: &Path) -> Vec<u8> {
        let map = |log: &PathBuf| {
            let map = log.with_extension("lat");
            let options = [
                "--direct",
                "--params",
                text(&self.params),
                "--map-out",
                text(&map),
            ];
            let mut command = Command::new(&self.lattice);
            command.args(["replay", text(log)]).args(options);
            assert!(command.output().unwrap().status.success());
            map
        };
        let maps: Vec<_> = self.logs.iter().map(map).collect();
        let out = folder.join("expected.lat");
        let mut command = Command::new(&self.lattice);
        command.args(["map", "merge", "-o", text(&out)]).args(maps);
        assert!(command.output().unwrap().status.success());
        fs::read(out).unwrap()
    }
}

#[test]
fn logs_in_slices_give_the_map_of_the_whole_logs() {
    let folder = tempfile::tempdir().unwrap();
    let Some(logs) = Logs::simulate(folder.path(), 2, "6", &[]) else {
        return;
    };
    let expected = logs.expected(folder.path());
    let out = folder.path().join("out.lat");
    for (number, slices) in [&[][..], &["--slice", "2.5"], &["--workers", "1"]]
        .into_iter()
        .enumerate()
    {
        let tables = folder.path().join(format!("tables{number}"));
        let report = json(&run(logs.map(&tables, slices)));
        let parts = if number == 1 { 6 } else { 2 };
        assert_eq!(report["parts_new"], parts);
        let again = json(&run(logs.map(&tables, slices)));
        assert_eq!(
            (&again["parts_new"], &again["parts_there"]),
            (&0.into(), &parts.into())
        );
        run(["merge", text(&tables), "--map-out", text(&out)]);
        assert_eq!(fs::read(&out).unwrap(), expected, "{slices:?}");
    }
    // The same log whole and in slices would count twice.
    let tables = folder.path().join("tables1");
    run(logs.map(&tables, &[]));
    let said = refused(["merge", text(&tables)]);
    assert!(said.contains("would count twice"), "{said}");
}

#[test]
fn a_log_that_cannot_be_mapped_is_named_and_the_others_are_mapped() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut logs) = Logs::simulate(folder.path(), 1, "2", &[]) else {
        return;
    };
    let broken = folder.path().join("broken.mcap");
    fs::write(&broken, "no log").unwrap();
    logs.logs
        .extend([broken.clone(), folder.path().join("missing")]);
    let tables = folder.path().join("tables");
    let said = refused(logs.map(&tables, &[]));
    assert!(
        said.contains("2 of 2 tasks failed") || said.contains("2 of 3 tasks failed"),
        "{said}"
    );
    assert!(
        said.contains("broken.mcap") && said.contains("missing"),
        "{said}"
    );
    assert_eq!(json(&run(["status", text(&tables), "--json"]))["parts"], 1);
}

#[test]
fn a_replay_adds_its_map_to_the_tables() {
    let folder = tempfile::tempdir().unwrap();
    let Some(logs) = Logs::simulate(folder.path(), 1, "2", &[]) else {
        return;
    };
    let tables = folder.path().join("tables");
    let programs = Path::new(env!("CARGO_BIN_EXE_lattice-fleet"))
        .parent()
        .unwrap();
    let path = std::env::join_paths([programs]).unwrap();
    let mut command = Command::new(&logs.lattice);
    command
        .env("PATH", path)
        .args(["replay", text(&logs.logs[0]), "--direct"]);
    command.args(["--params", text(&logs.params), "--out-table", text(&tables)]);
    assert!(command.output().unwrap().status.success());
    let out = folder.path().join("out.lat");
    run(["from-table", text(&tables), "-o", text(&out)]);
    assert_eq!(fs::read(out).unwrap(), logs.expected(folder.path()));
}
