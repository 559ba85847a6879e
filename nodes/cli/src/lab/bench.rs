//! `lattice bench`: one measurement a call, one line of JSON.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use lattice_core::lattice::{Lattice, LatticeKind};

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

/// What every measurement needs.
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
    /// How points become keys
    #[arg(long, value_enum, default_value = "batch")]
    method: QuantizeName,
}

/// Options of `lattice bench insert`.
#[derive(Args)]
pub struct Insert {
    #[command(flatten)]
    common: Common,
    /// What holds the voxels
    #[arg(long, value_enum, default_value = "occupancy")]
    store: StoreName,
    /// Insert scan by scan, as FILE.scans says, not all points at once
    #[arg(long)]
    scans: bool,
}

/// Options of `lattice bench neighbors`.
#[derive(Args)]
pub struct Neighbors {
    #[command(flatten)]
    common: Common,
    /// What holds the voxels
    #[arg(long, value_enum, default_value = "occupancy")]
    store: StoreName,
    /// How neighbours are found
    #[arg(long, value_enum, default_value = "pass")]
    method: NeighborName,
}

/// Options of `lattice bench raycast`.
#[derive(Args)]
pub struct Raycast {
    #[command(flatten)]
    common: Common,
    /// Use of the rays
    #[arg(long, value_enum, default_value = "map")]
    method: RaycastName,
}

/// Options of `lattice bench file`.
#[derive(Args)]
pub struct MapFile {
    #[command(flatten)]
    common: Common,
    /// Which way
    #[arg(long, value_enum, default_value = "save")]
    method: FileName,
    /// Pack by zstd at this level, 1 to 19
    #[arg(long, value_parser = clap::value_parser!(i32).range(1..=19))]
    zstd: Option<i32>,
}

#[derive(Clone, Copy, ValueEnum)]
enum RaycastName {
    /// Log-odds of all cells, free ones too
    Map,
    /// Voxels, without those that rays pass through: `free_space: clear` of the mapper
    Clear,
    /// Voxels, without those that are free by the log-odds: `free_space: evidence`
    Evidence,
}

#[derive(Clone, Copy, ValueEnum)]
enum FileName {
    /// From a store to the bytes of a file
    Save,
    /// From the bytes of a file to a store
    Load,
}

#[derive(Clone, Copy, ValueEnum)]
enum QuantizeName {
    /// The batch quantizer with the best instructions of this machine
    Batch,
    /// The batch quantizer with what every machine of the target has
    Portable,
    /// One point at a time in f64
    Scalar,
    /// The nearest of 27 candidates, as Ryde & Brünig 2011 do it
    Paper27,
}

#[derive(Clone, Copy, ValueEnum)]
enum StoreName {
    /// One bit of each voxel
    Occupancy,
    /// Count and sum of offsets of each voxel
    List,
}

#[derive(Clone, Copy, ValueEnum)]
enum NeighborName {
    /// One pass over the blocks of the store's cells
    Pass,
    /// One look-up in the store for each touching neighbour
    Probe,
    /// The measure: 26 probes of a hash set for each voxel of the cubic lattice
    Hash26,
}

impl StoreName {
    fn store(self) -> Store {
        match self {
            Self::Occupancy => Store::Occupancy,
            Self::List => Store::List,
        }
    }
}

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
        let method = match self.method {
            QuantizeName::Batch => QuantizeMethod::Batch,
            QuantizeName::Portable => QuantizeMethod::Portable,
            QuantizeName::Scalar => QuantizeMethod::Scalar,
            QuantizeName::Paper27 => QuantizeMethod::Paper27,
        };
        let cell = self.common.cell;
        let report = self
            .common
            .pool()?
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
        let (report, _) = self
            .common
            .pool()?
            .install(|| bench::insert(options, &lattice, points, scans.as_deref()))?;
        self.common.print(&report)
    }
}

impl Neighbors {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let options = self.common.insert_options(self.store);
        let method = match self.method {
            NeighborName::Pass => NeighborMethod::Pass,
            NeighborName::Probe => NeighborMethod::Probe,
            NeighborName::Hash26 => NeighborMethod::Hash26,
        };
        let (name, cell) = (self.store.store().name(), self.common.cell);
        let report = self.common.pool()?.install(|| {
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
        let method = match self.method {
            RaycastName::Map => RaycastMethod::Map,
            RaycastName::Clear => RaycastMethod::Clear,
            RaycastName::Evidence => RaycastMethod::Evidence,
        };
        let report = self
            .common
            .pool()?
            .install(|| bench::raycast(method, &lattice, cell, points, &scans))?;
        self.common.print(&report)
    }
}

impl MapFile {
    fn run(self) -> CliResult {
        let lattice = self.common.lattice()?;
        let points = self.common.points()?;
        let method = match self.method {
            FileName::Save => FileMethod::Save,
            FileName::Load => FileMethod::Load,
        };
        let (options, cell) = (
            self.common.insert_options(StoreName::Occupancy),
            self.common.cell,
        );
        let report = self.common.pool()?.install(|| {
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

    fn points(&self) -> Result<Vec<[f32; 3]>, bench::PointFileError> {
        bench::read_points(&self.points, self.max_points)
    }

    fn pool(&self) -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
        let threads = self.threads.max(1);
        rayon::ThreadPoolBuilder::new().num_threads(threads).build()
    }

    fn insert_options(&self, store: StoreName) -> InsertOptions {
        InsertOptions {
            store: store.store(),
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
