//! `lattice bench`: one measurement a call, one line of JSON.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use lattice_core::lattice::{Lattice, LatticeKind};

use super::choice;
use crate::{CliResult, init_logging};
use lattice_lab::bench::{
    self, FileMethod, InsertOptions, NeighborMethod, QuantizeMethod, RaycastMethod, Report, Store,
};

/// Measure operations on a raw point file (f32 `x y z i`; see `lattice simulate site`)
///
/// The points are in memory before the clock starts; only the operation itself is timed.
#[derive(Subcommand)]
pub enum Bench {
    /// Quantize all points and pack their keys, without a store
    Quantize(Quantize),
    /// Insert all points into a store
    Insert(Insert),
    /// Count the occupied touching neighbours of all voxels
    Neighbors(Neighbors),
    /// Clear free space along the rays of all scans, as FILE.scans has them
    Raycast(Raycast),
    /// Save the occupied voxels as a map file in memory, or load them
    File(MapFile),
    /// Prepare two point files of any format and register one to the other
    Register(super::bench_register::Register),
}

/// Options of every measurement.
#[derive(Args)]
struct Common {
    /// Point file
    #[arg(long)]
    points: PathBuf,
    /// Use only so many points from the start of the file
    #[arg(long, default_value_t = 500_000_000)]
    max_points: usize,
    /// Side of a cube with the volume of a cell, m
    #[arg(long)]
    cell: f64,
    /// cubic, bcc, fcc, mcc or hex
    #[arg(long, default_value = "fcc")]
    lattice: LatticeKind,
    /// Threads of the operation
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Print the result as one line of JSON
    #[arg(long)]
    json: bool,
}

/// Options of `lattice bench quantize`.
#[derive(Args)]
pub struct Quantize {
    #[command(flatten)]
    common: Common,
    /// Way to quantize
    #[arg(long, value_parser = choice(&QUANTIZERS), default_value = "batch")]
    method: QuantizeMethod,
}

/// Options of `lattice bench insert`.
#[derive(Args)]
pub struct Insert {
    #[command(flatten)]
    common: Common,
    /// Store of the voxels
    #[arg(long, value_parser = choice(&STORES), default_value = "occupancy")]
    store: Store,
    /// Insert scan by scan, as FILE.scans says, not all points at once
    #[arg(long)]
    scans: bool,
}

/// Options of `lattice bench neighbors`.
#[derive(Args)]
pub struct Neighbors {
    #[command(flatten)]
    common: Common,
    /// Store of the voxels
    #[arg(long, value_parser = choice(&STORES), default_value = "occupancy")]
    store: Store,
    /// Way to find neighbours
    #[arg(long, value_parser = choice(&NEIGHBORS), default_value = "pass")]
    method: NeighborMethod,
}

/// Options of `lattice bench raycast`.
#[derive(Args)]
pub struct Raycast {
    #[command(flatten)]
    common: Common,
    /// Use of the rays
    #[arg(long, value_parser = choice(&RAYCASTS), default_value = "map")]
    method: RaycastMethod,
}

/// Options of `lattice bench file`.
#[derive(Args)]
pub struct MapFile {
    #[command(flatten)]
    common: Common,
    /// Direction
    #[arg(long, value_parser = choice(&FILES), default_value = "save")]
    method: FileMethod,
    /// Pack by zstd at this level, 1 to 19
    #[arg(long, value_parser = clap::value_parser!(i32).range(1..=19))]
    zstd: Option<i32>,
}

/// Values of `--method` of `lattice bench file`.
const FILES: [(&str, &str, FileMethod); 2] = [
    (
        "save",
        "From a store to the bytes of a file",
        FileMethod::Save,
    ),
    (
        "load",
        "From the bytes of a file to a store",
        FileMethod::Load,
    ),
];

/// Values of `--method` of `lattice bench raycast`.
const RAYCASTS: [(&str, &str, RaycastMethod); 3] = [
    (
        "map",
        "Log-odds of all cells, free ones too",
        RaycastMethod::Map,
    ),
    (
        "clear",
        "Voxels, without those that rays pass through: `free_space: clear` of the mapper",
        RaycastMethod::Clear,
    ),
    (
        "evidence",
        "Voxels, without those that are free by the log-odds: `free_space: evidence`",
        RaycastMethod::Evidence,
    ),
];

/// Values of `--method` of `lattice bench quantize`.
const QUANTIZERS: [(&str, &str, QuantizeMethod); 4] = [
    (
        "batch",
        "The batch quantizer with the best instructions of this machine",
        QuantizeMethod::Batch,
    ),
    (
        "portable",
        "The batch quantizer with what every machine of the target has",
        QuantizeMethod::Portable,
    ),
    (
        "scalar",
        "One point at a time in f64",
        QuantizeMethod::Scalar,
    ),
    (
        "paper27",
        "The nearest of 27 candidates, as Ryde & Brünig 2011 do it",
        QuantizeMethod::Paper27,
    ),
];

/// Values of `--store`.
const STORES: [(&str, &str, Store); 2] = [
    ("occupancy", "One bit of each voxel", Store::Occupancy),
    (
        "list",
        "Count and sum of offsets of each voxel",
        Store::List,
    ),
];

/// Values of `--method` of `lattice bench neighbors`.
const NEIGHBORS: [(&str, &str, NeighborMethod); 3] = [
    (
        "pass",
        "One pass over the blocks of the store's cells",
        NeighborMethod::Pass,
    ),
    (
        "probe",
        "One look-up in the store for each touching neighbour",
        NeighborMethod::Probe,
    ),
    (
        "hash26",
        "The measure: 26 probes of a hash set for each voxel of the cubic lattice",
        NeighborMethod::Hash26,
    ),
];

impl Bench {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        match self {
            Self::Quantize(command) => command.run(),
            Self::Insert(command) => command.run(),
            Self::Neighbors(command) => command.run(),
            Self::Raycast(command) => command.run(),
            Self::File(command) => command.run(),
            Self::Register(command) => command.run(),
        }
    }
}

impl Quantize {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let method = self.method;
        let cell = self.common.cell;
        let report = lattice_lab::pool(self.common.threads)?
            .install(|| bench::quantize(method, &lattice, cell, &points));
        self.common.print(&report)
    }
}

impl Insert {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let scans = match self.scans {
            true => Some(bench::read_scans(&self.common.points, points.len())?),
            false => None,
        };
        let options = self.common.insert_options(self.store);
        let (report, _) = lattice_lab::pool(self.common.threads)?
            .install(|| bench::insert(options, &lattice, points, scans.as_deref()))?;
        self.common.print(&report)
    }
}

impl Neighbors {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let options = self.common.insert_options(self.store);
        let method = self.method;
        let (name, cell) = (self.store.name(), self.common.cell);
        let report = lattice_lab::pool(self.common.threads)?.install(|| {
            let (_, store) = bench::insert(options, &lattice, points, None)?;
            Ok::<_, lattice_core::voxels::DatumError>(bench::neighbors(
                method,
                store.as_ref(),
                name,
                cell,
            ))
        })?;
        let report = report.ok_or("--method hash26 is the measure for --lattice cubic only")?;
        self.common.print(&report)
    }
}

impl Raycast {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let scans = bench::read_scans(&self.common.points, points.len())?;
        let cell = self.common.cell;
        let report = lattice_lab::pool(self.common.threads)?
            .install(|| bench::raycast(self.method, &lattice, cell, points, &scans))?;
        self.common.print(&report)
    }
}

impl MapFile {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let method = self.method;
        let (options, cell) = (
            self.common.insert_options(Store::Occupancy),
            self.common.cell,
        );
        let report = lattice_lab::pool(self.common.threads)?.install(|| {
            let (_, store) = bench::insert(options, &lattice, points, None)?;
            bench::file(method, store.as_ref(), self.zstd, cell)
        })?;
        self.common.print(&report)
    }
}

impl Common {
    fn lattice(&self) -> Result<Lattice, lattice_core::lattice::LatticeError> {
        Lattice::new(self.lattice, self.cell * self.cell * self.cell)
    }

    fn points(&self) -> Result<Vec<[f32; 3]>, lattice_lab::AnyError> {
        bench::read_points(&self.points, self.max_points)
    }

    fn insert_options(&self, store: Store) -> InsertOptions {
        InsertOptions {
            store,
            res_m: self.cell,
        }
    }

    fn print(&self, report: &Report) -> CliResult {
        if self.json {
            println!("{}", serde_json::to_string(report)?);
            return Ok(());
        }
        let rate = report.n as f64 / report.wall_s / 1e6;
        println!(
            "{} {} {} m, {} threads: {} in {:.4} s ({rate:.1} M/s), {:.4} s of processor time, {} voxels, {} bytes",
            report.sys,
            report.lattice,
            report.res,
            report.threads,
            report.n,
            report.wall_s,
            report.cpu_s,
            report.voxels,
            report.bytes
        );
        Ok(())
    }
}
