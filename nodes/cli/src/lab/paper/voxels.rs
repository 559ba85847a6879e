//! `lattice paper voxels`: Ryde & Brünig 2011, computed anew.

use super::{ReportOptions, make};
use crate::CliResult;
use clap::Args;
use lattice_lab::paper::voxels::{Options, run};
use std::path::PathBuf;

/// Options of `lattice paper voxels`.
#[derive(Args)]
pub struct Voxels {
    #[command(flatten)]
    report: ReportOptions,
    /// Fewer samples and trials, in less than a minute
    #[arg(long)]
    quick: bool,
    /// A point file of one scan (ply, pcd, xyz, KITTI bin) for Fig. 5; may be given several times
    #[arg(long = "scan", value_name = "FILE")]
    scans: Vec<PathBuf>,
    /// A rosbag2 log of clouds and an INS for Table I; may be given several times
    #[arg(long = "bag", value_name = "DIR")]
    bags: Vec<PathBuf>,
    /// Folder of pairs of scans for Fig. 6: small_gicp/{target,source}.ply with T_target_source.txt, and
    /// room_scan{1,2}.pcd; either may be missing
    #[arg(long, value_name = "DIR")]
    pairs: Option<PathBuf>,
    /// Point files of a map and of a scan for Fig. 6, and a text file with the scan's pose in the map, 4 x 4
    /// numbers row by row; may be given several times
    #[arg(long = "pair", num_args = 3, value_names = ["MAP", "SCAN", "POSE"])]
    pair_files: Vec<PathBuf>,
}

impl Voxels {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let options = Options {
            seed: self.report.seed,
            quick: self.quick,
            scans: self.scans,
            bags: self.bags,
            pairs: self.pairs,
            pair_files: self.pair_files.as_chunks().0.to_vec(),
        };
        make(&self.report, |progress| run(&options, progress))
    }
}
