//! `lattice simulate town`.

use crate::CliResult;
use crate::lab::{Choice, choice, show};
use clap::Args;
use lattice_lab::datasets::{TownOptions, write_town};
use lattice_lab::simulate::town::Lidar;
use std::path::PathBuf;

/// Options of `lattice simulate town`.
#[derive(Args)]
pub struct Town {
    /// Folder of map.ply and cloud.ply with labels, map_from_cloud.txt and classes.yaml
    #[arg(long, default_value = "town")]
    out: PathBuf,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Distance of the scans along the street, m
    #[arg(long, default_value_t = 10.0, value_parser = distance)]
    apart: f64,
    /// The lidar
    #[arg(long, value_parser = choice(&LIDARS), default_value = "64")]
    lidar: Lidar,
    /// Replace files that are already there
    #[arg(long)]
    overwrite: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Values of `--lidar`.
const LIDARS: [Choice<Lidar>; 2] = [
    ("64", "64 beams from 25 degrees below level", Lidar::HDL64),
    ("16", "16 beams, 15 degrees about level", Lidar::VLP16),
];

fn distance(text: &str) -> Result<f64, String> {
    let m = text.parse::<f64>().ok();
    m.filter(|m| (0.0..=60.0).contains(m))
        .ok_or_else(|| "from 0 to 60 m".to_owned())
}

impl Town {
    pub(super) fn run(self) -> CliResult {
        let options = TownOptions {
            out: self.out,
            overwrite: self.overwrite,
            seed: self.seed,
            apart_m: self.apart,
            lidar: self.lidar,
        };
        show(self.json, &write_town(&options)?)
    }
}
