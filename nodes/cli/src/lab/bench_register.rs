//! `lattice bench register`.

use crate::CliResult;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lattice_core::registration::{NamedMethod, PrepareOptions, RegisterOptions, SemanticCloud};
use lattice_lab::bench::{self, RegisterSetup};
use lattice_nodes::files::points::{PointFileOptions, read_points};
use std::path::{Path, PathBuf};

/// Options of `lattice bench register`.
#[derive(Args)]
pub struct Register {
    /// Point file that is moved
    #[arg(long)]
    source: PathBuf,
    /// Point file that stays
    #[arg(long)]
    target: PathBuf,
    /// Registration method
    #[arg(long, value_parser = method_parser(), default_value = "gicp")]
    method: &'static NamedMethod,
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

/// Methods that need no labels.
fn method_parser() -> impl TypedValueParser<Value = &'static NamedMethod> {
    let plain = ["icp", "gicp", "gicp-se3"];
    PossibleValuesParser::new(plain).try_map(|option: String| {
        let found = NamedMethod::ALL.iter().find(|m| m.option == option);
        found.ok_or("no such method")
    })
}

impl Register {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let (source, target) = (points(&self.source)?, points(&self.target)?);
        let setup = RegisterSetup {
            options: RegisterOptions {
                gate_m: self.gate,
                ..self.method.options(self.gate)
            },
            prepare: PrepareOptions {
                neighbors: self.neighbors,
                ..PrepareOptions::default()
            },
            cell_m: self.cell,
            rounds: self.rounds,
        };
        let pool = lattice_lab::pool(self.threads)?;
        let report =
            pool.install(|| bench::register(self.method.option, &source, &target, &setup))?;
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
    let file = read_points(path, &PointFileOptions::default())
        .map_err(|error| format!("{}: {error}", path.display()))?;
    // The peers keep rays without return, which are at 0 0 0.
    let no_returns = std::iter::repeat_n([0.0; 3], file.no_returns);
    let points_m = file.points_m.into_iter().chain(no_returns);
    Ok(SemanticCloud::unlabelled(
        points_m.map(Into::into).collect(),
    ))
}
