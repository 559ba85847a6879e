//! Maps, calls of the program, and what they gave.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_core::voxels::{Payload, VoxelList};
use lattice_fleet::files::{sealed, unsealed};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Recipe of a map.
#[derive(Clone, Copy)]
pub struct Recipe {
    pub kind: LatticeKind,
    pub volume_m3: f64,
    pub datum_m: [f64; 3],
    pub labels: bool,
    pub points: usize,
    pub seed: u64,
}

impl Recipe {
    pub fn new(seed: u64) -> Recipe {
        Recipe {
            kind: LatticeKind::Fcc,
            volume_m3: 0.05,
            datum_m: [0.0; 3],
            labels: true,
            points: 4000,
            seed,
        }
    }

    /// Points in several tiles, with labels and stamps.
    pub fn map(&self) -> MapContents {
        let lattice = Lattice::new(self.kind, self.volume_m3).unwrap();
        let list = VoxelList::new(lattice, self.datum_m.into(), usize::MAX).unwrap();
        let mut list = list.with_payload(Payload {
            stamps: true,
            labels: self.labels,
            ..Payload::default()
        });
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        for scan in 0..4 {
            let mut coordinate = || random.random_range(-130.0..130.0_f64);
            let points_m: Vec<_> = (0..self.points / 4)
                .map(|_| {
                    Vector3::new(coordinate(), coordinate(), coordinate() / 50.0)
                        .map(|x: f64| (x / 2.0).round() * 2.0 + x / 1e4)
                })
                .collect();
            let cloud =
                Cloud::from_points(1000 * scan + self.seed as i64, Vector3::zeros(), &points_m);
            let labels: Vec<u16> = (0..cloud.len()).map(|i| (i % 7) as u16).collect();
            let labels = if self.labels { &labels[..] } else { &[] };
            list.insert_labelled(&cloud, labels);
        }
        MapContents::from_list(&list)
    }

    /// Writes the map below a folder.
    pub fn write(&self, folder: &Path) -> PathBuf {
        let path = folder.join(format!("{}-{}.lat", self.kind.name(), self.seed));
        write_map(&self.map(), &path);
        path
    }
}

pub fn write_map(map: &MapContents, path: &Path) {
    let mut bytes = Vec::new();
    map.write(&mut bytes, &WriteOptions::default()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// The map that `lattice map merge` makes of maps in this order.
pub fn merged(maps: impl IntoIterator<Item = MapContents>) -> Vec<u8> {
    let all = maps.into_iter().reduce(|mut all, map| {
        all.merge(map).unwrap();
        all
    });
    let mut bytes = Vec::new();
    all.unwrap()
        .write(&mut bytes, &WriteOptions::default())
        .unwrap();
    bytes
}

/// Calls the program.
pub fn fleet<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    program().args(arguments).output().unwrap()
}

pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_lattice-fleet"))
}

/// Calls the program, which must succeed; gives its standard output.
pub fn run<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> String {
    let output = fleet(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {said}", output.status);
    String::from_utf8(output.stdout).unwrap()
}

/// Calls the program, which must fail; gives what it said.
pub fn refused<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> String {
    let output = fleet(arguments);
    assert!(!output.status.success());
    String::from_utf8(output.stderr).unwrap()
}

/// Text of a path.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Figures of a command that was given `--json`.
pub fn json(output: &str) -> serde_json::Value {
    serde_json::from_str(output).unwrap()
}

/// The folders of the parts, sorted.
pub fn parts(tables: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(tables.join("parts")).unwrap();
    let mut parts: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    parts.sort();
    parts
}

/// A Parquet file of the first part.
pub fn some_table(tables: &Path) -> PathBuf {
    let part = parts(tables).remove(0);
    let mut tiles: Vec<_> = fs::read_dir(part)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    tiles.sort();
    let tile = tiles.into_iter().find(|path| path.is_dir()).unwrap();
    tile.join("voxels.parquet")
}

/// The text of a manifest that somebody has changed and sealed again.
pub fn sealed_again(text: &str) -> String {
    let digest = json(text)["digest"].as_str().unwrap().to_owned();
    sealed(&unsealed(text, &digest))
}

/// A program or a Python from the environment; says which test is skipped where there is none.
pub fn from_environment(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os(name).map(PathBuf::from);
    if path.is_none() {
        eprintln!("skipped: {name} is not set");
    }
    path
}
