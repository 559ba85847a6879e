//! `lattice bench`: one measurement a call, one line of JSON.

use super::{Choice, choice};
use crate::{CliResult, init_logging};
use clap::{Args, Subcommand};
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_lab::AnyError;
use lattice_lab::bench::FileMethod::{Load, Save};
use lattice_lab::bench::NeighborMethod::{Hash26, Pass, Probe};
use lattice_lab::bench::QuantizeMethod::{Batch, Paper27, Portable, Scalar};
use lattice_lab::bench::QuantizeOutput::{Indices, Keys, NewIndices};
use lattice_lab::bench::RaycastMethod::{Clear, Evidence, Map};
use lattice_lab::bench::Store::List;
use lattice_lab::bench::{
    self, FileMethod, NeighborMethod, QuantizeMethod, QuantizeOutput, RaycastMethod, Report, Store,
};
use std::path::PathBuf;

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
    /// Send images of a camera to the node `semantic_cloud`: latency of its clouds, processor time
    Camera(super::bench_camera::Camera),
    /// Run a network on an image, as the node `segmenter` does
    Segment(super::bench_segment::Segment),
    /// Send clouds to another process over the DDS of the nodes: loss, latency, processor time
    Transport(super::bench_transport::Transport),
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
    /// Edge of the cube with the volume of one cell, m
    #[arg(long = "cell-size", alias = "cell", value_name = "M")]
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
    /// Output; indices only by `--method batch`
    #[arg(long, value_parser = choice(&OUTPUTS), default_value = "keys")]
    output: QuantizeOutput,
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
const FILES: [Choice<FileMethod>; 2] = [
    ("save", "From a store to the bytes of a file", Save),
    ("load", "From the bytes of a file to a store", Load),
];

/// Values of `--method` of `lattice bench raycast`.
const RAYCASTS: [Choice<RaycastMethod>; 3] = [
    ("map", "Log-odds of all cells, free ones too", Map),
    ("clear", CLEAR, Clear),
    ("evidence", EVIDENCE, Evidence),
];
const CLEAR: &str =
    "Voxels, without those that rays pass through: `free_space: clear` of the mapper";
const EVIDENCE: &str =
    "Voxels, without those that are free by the log-odds: `free_space: evidence`";

/// Values of `--method` of `lattice bench quantize`.
const QUANTIZERS: [Choice<QuantizeMethod>; 4] = [
    ("batch", BATCH, Batch),
    ("portable", PORTABLE, Portable),
    ("scalar", "One point at a time in f64", Scalar),
    ("paper27", PAPER27, Paper27),
];

/// Values of `--output` of `lattice bench quantize`.
const OUTPUTS: [Choice<QuantizeOutput>; 3] = [
    ("keys", "Keys, in memory that was written before", Keys),
    (
        "indices",
        "Indices, in memory that was written before",
        Indices,
    ),
    (
        "new-indices",
        "Indices, in memory that is asked for while the clock runs",
        NewIndices,
    ),
];
const BATCH: &str = "The batch quantizer with the best instructions of this machine";
const PORTABLE: &str = "The batch quantizer with the baseline instructions of the target";
const PAPER27: &str = "The nearest of 27 candidates, as Ryde & Brünig 2011 do it";

/// Values of `--store`.
const STORES: [Choice<Store>; 2] = [
    ("occupancy", "One bit of each voxel", Store::Occupancy),
    ("list", "Count and sum of offsets of each voxel", List),
];

/// Values of `--method` of `lattice bench neighbors`.
const NEIGHBORS: [Choice<NeighborMethod>; 3] = [
    (
        "pass",
        "One pass over the blocks of the store's cells",
        Pass,
    ),
    ("probe", PROBE, Probe),
    ("hash26", HASH26, Hash26),
];
const PROBE: &str = "One look-up in the store for each touching neighbour";
const HASH26: &str = "The measure: 26 probes of a hash set for each voxel of the cubic lattice";

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
            Self::Camera(command) => command.run(),
            Self::Segment(command) => command.run(),
            Self::Transport(command) => command.run(),
        }
    }
}

impl Quantize {
    fn run(self) -> CliResult {
        if self.output != Keys && self.method != Batch {
            return Err("--output indices is measured with --method batch only".into());
        }
        self.common.measure(|lattice, points| {
            Ok(bench::quantize(self.method, self.output, lattice, &points))
        })
    }
}

impl Insert {
    fn run(self) -> CliResult {
        self.common.measure(|lattice, points| {
            let scans = self.scans.then(|| self.common.scans(&points)).transpose()?;
            Ok(bench::insert(self.store, lattice, points, scans.as_deref())?.0)
        })
    }
}

impl Neighbors {
    fn run(self) -> CliResult {
        self.common.measure(|lattice, points| {
            let (_, store) = bench::insert(self.store, lattice, points, None)?;
            let report = bench::neighbors(self.method, store.as_ref(), self.store.name());
            Ok(report.ok_or("--method hash26 is the measure for --lattice cubic only")?)
        })
    }
}

impl Raycast {
    fn run(self) -> CliResult {
        self.common.measure(|lattice, points| {
            let scans = self.common.scans(&points)?;
            Ok(bench::raycast(self.method, lattice, points, &scans)?)
        })
    }
}

impl MapFile {
    fn run(self) -> CliResult {
        self.common.measure(|lattice, points| {
            let (_, store) = bench::insert(Store::Occupancy, lattice, points, None)?;
            bench::file(self.method, store.as_ref(), self.zstd)
        })
    }
}

impl Common {
    /// Measures an operation on the points, on a pool of the threads, and prints the report.
    fn measure(
        &self,
        operation: impl FnOnce(&Lattice, Vec<[f32; 3]>) -> Result<Report, AnyError> + Send,
    ) -> CliResult {
        let lattice = Lattice::new(self.lattice, self.cell * self.cell * self.cell)?;
        let points = bench::read_points(&self.points, self.max_points)?;
        let report = lattice_lab::pool(self.threads)?.install(|| operation(&lattice, points))?;
        self.print(&report)
    }

    fn scans(&self, points: &[[f32; 3]]) -> Result<Vec<bench::ScanRecord>, AnyError> {
        bench::read_scans(&self.points, points.len())
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
