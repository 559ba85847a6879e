//! `lattice evaluate chain`.

use super::evaluate_many::show;
use super::processors;
use super::remaining::with_remaining;
use crate::CliResult;
use clap::Args;
use lattice_lab::evaluate::{ChainOptions, Results, chain_report, chain_settings, run_chain};
use lattice_lab::models;
use std::path::PathBuf;

/// Options of `lattice evaluate chain`.
#[derive(Args)]
pub struct Chain {
    /// Folder of the results and the report; an ended run is continued
    #[arg(long)]
    out: PathBuf,
    /// PLY of a house, metres, z up, with `label` and `instance` of each face [default: a house of our own]
    #[arg(long, value_name = "PLY", requires = "classes")]
    mesh: Option<PathBuf>,
    /// YAML with the names of its classes, which must be those of the network
    #[arg(long, value_name = "YAML", requires = "mesh")]
    classes: Option<PathBuf>,
    /// Network of the classes of the house, an ONNX file [default: the one that was trained on other rooms]
    #[arg(long, value_name = "ONNX")]
    model: Option<PathBuf>,
    /// Trials of each scene
    #[arg(long, default_value_t = 10)]
    seeds: u64,
    /// Surveys of the robot, each with other materials and lamps
    #[arg(long, default_value_t = 3)]
    maps: u64,
    /// Views of a survey
    #[arg(long, default_value_t = 192)]
    views: usize,
    /// Pictures that the headset takes at a scene, 1 to 6: of the thing itself, then to its sides
    #[arg(long, default_value_t = 3)]
    looks: usize,
    /// Trials at once [default: as many as processors]
    #[arg(long)]
    threads: Option<usize>,
}

impl Chain {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        if !cfg!(feature = "onnx") {
            let words = "networks are not built in; build with `cargo build --release --features onnx --bin lattice`";
            return Err(words.into());
        }
        let folder = tempfile::tempdir()?;
        let model = match self.model {
            Some(model) => model,
            None => models::write_rooms(folder.path())?,
        };
        let options = ChainOptions {
            seeds: self.seeds,
            maps: self.maps,
            views: self.views,
            looks: self.looks,
            mesh: self.mesh.zip(self.classes),
            model,
            threads: self.threads.unwrap_or_else(processors).clamp(1, 1024),
        };
        let mut results = Results::open(&self.out, &chain_settings(&options)?)?;
        with_remaining(|told| run_chain(&options, &mut results, told))?;
        show(&chain_report(&results.sorted()), &self.out)
    }
}
