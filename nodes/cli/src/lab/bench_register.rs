//! `lattice bench register`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use lattice_core::registration::{Method, PrepareOptions, SemanticCloud};
use nalgebra::Isometry3;

use crate::CliResult;
use lattice_lab::bench::{self, RegisterSetup};
use lattice_nodes::files::points::{PointFileLimits, read_points};

/// Options of `lattice bench register`.
#[derive(Args)]
pub struct Register {
    /// Point file that is moved
    #[arg(long)]
    source: PathBuf,
    /// Point file that stays
    #[arg(long)]
    target: PathBuf,
    /// What is minimised
    #[arg(long, value_enum, default_value = "gicp")]
    method: MethodName,
    /// Longest distance of a pair, m
    #[arg(long, default_value_t = 1.0)]
    gate: f64,
    /// Points of the neighbourhood of a covariance
    #[arg(long, default_value_t = 20)]
    neighbors: usize,
    /// Thin both clouds to the means of cells of this side while the clock runs, m
    #[arg(long)]
    cell: Option<f64>,
    /// Measured runs; one more goes before
    #[arg(long, default_value_t = 10)]
    rounds: usize,
    /// Threads
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Print the result as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodName {
    /// Point-to-point ICP
    Icp,
    /// GICP with the tolerances of small_gicp
    Gicp,
    /// GICP-SE(3) with a Cauchy kernel
    GicpSe3,
}

impl Register {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let (source, target) = (points(&self.source)?, points(&self.target)?);
        let (method, name) = match self.method {
            MethodName::Icp => (Method::PointToPoint, "icp"),
            MethodName::Gicp => (Method::Gicp, "gicp"),
            MethodName::GicpSe3 => (Method::GicpSe3, "gicp-se3"),
        };
        let setup = RegisterSetup {
            options: bench::register_options(method, self.gate),
            prepare: PrepareOptions {
                neighbors: self.neighbors,
                ..PrepareOptions::default()
            },
            cell_m: self.cell,
            target_from_source: Isometry3::identity(),
            rounds: self.rounds,
        };
        let threads = rayon::ThreadPoolBuilder::new().num_threads(self.threads.max(1));
        let report = threads
            .build()?
            .install(|| bench::register(name, &source, &target, &setup))?;
        if self.json {
            println!("{}", serde_json::to_string(&report)?);
            return Ok(());
        }
        let ms = |all: &[f64]| 1e3 * all.iter().copied().fold(f64::INFINITY, f64::min);
        println!(
            "{} of {} to {} points, {} threads: at best {:.2} ms to prepare, {:.2} ms to register in {} iterations",
            report.sys,
            report.source_points,
            report.target_points,
            report.threads,
            ms(&report.wall.prepare),
            ms(&report.wall.register),
            report.iterations
        );
        Ok(())
    }
}

fn points(path: &Path) -> Result<SemanticCloud, String> {
    let file = read_points(path, &PointFileLimits::default())
        .map_err(|error| format!("{}: {error}", path.display()))?;
    let points_m = file.points_m.into_iter().map(Into::into).collect();
    Ok(SemanticCloud::unlabelled(points_m))
}
