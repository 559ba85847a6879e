//! `lattice fleet merge`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use lattice_fleet::Result;
use lattice_fleet::engine::{Engine, Limits};
use lattice_fleet::merge::{MergeOptions, merge};
use lattice_fleet::merged::read_merged;
use lattice_fleet::tables::Tables;

use crate::table::write_map;
use crate::{block_on, cores, progress};

/// Options of `lattice fleet merge`.
#[derive(Args)]
pub struct Merge {
    /// Folder of tables
    tables: PathBuf,
    /// Folder of the merged map [default: the folder `merged` of the tables]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the merged map as a map file too, with the bytes of `lattice map merge`
    #[arg(long, value_name = "FILE")]
    map_out: Option<PathBuf>,
    /// `embedded`, or a cluster: ballista://HOST:PORT
    #[arg(long, default_value = "embedded")]
    engine: Engine,
    /// Threads of the embedded engine; 0: all cores
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Memory of the embedded engine for grouping, MB; more is spilled to temporary files
    #[arg(long, default_value_t = 1024, value_name = "MB")]
    memory: usize,
    /// Input rows of one query; bounds the memory for its result
    #[arg(long, default_value_t = 4_000_000, value_name = "N")]
    rows_at_once: u64,
    /// Merge logs without a geodetic origin as they are: the poses of all logs are in one map frame
    #[arg(long)]
    same_frame: bool,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

impl Merge {
    /// Runs the command.
    pub fn run(self) -> Result {
        let begin = Instant::now();
        let tables = Tables::open(&self.tables)?;
        let threads = if self.threads == 0 {
            cores()
        } else {
            self.threads
        };
        let options = MergeOptions {
            out: self.out.unwrap_or_else(|| self.tables.join("merged")),
            engine: self.engine,
            limits: Limits {
                threads,
                memory_bytes: self.memory.saturating_mul(1 << 20),
            },
            rows_at_once: self.rows_at_once,
            same_frame: self.same_frame,
        };
        let bar = progress::bar("merge", 1000);
        let mut show = |done: f64| bar.set_position((done * 1000.0) as u64);
        let report = block_on(threads, merge(&tables, &options, &mut show))?;
        if let Some(path) = &self.map_out {
            bar.set_message("writing the map file");
            write_map(&read_merged(&options.out)?, path, None)?;
        }
        bar.finish_and_clear();
        if self.json {
            println!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(());
        }
        println!(
            "{} parts: {} voxels of {} points in {} tiles, {} of them kept, {} bytes, {:.2} s",
            report.parts,
            report.voxels,
            report.points,
            report.tiles,
            report.tiles_kept,
            report.bytes,
            begin.elapsed().as_secs_f64()
        );
        Ok(())
    }
}
