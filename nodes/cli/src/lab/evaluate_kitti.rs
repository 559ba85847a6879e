//! `lattice evaluate kitti`.

use crate::CliResult;
use crate::progress::Progress;
use clap::Args;
use lattice_lab::evaluate::kitti::{
    KittiMethod, KittiReport, KittiTopics, PairRow, Prepared, RIGHT, kitti_report, pairs_of,
    read_scans, write_scans,
};
use lattice_lab::{markdown, write_report};
use lattice_nodes::files::atomic_write::write_text;
use std::path::PathBuf;

/// Options of `lattice evaluate kitti`.
#[derive(Args)]
pub struct Kitti {
    /// Log with labelled scans and the odometry of an INS
    #[arg(long)]
    bag: PathBuf,
    /// Folder of the scans, kitti.json and report.html
    #[arg(long)]
    out: PathBuf,
    /// Labelled scans
    #[arg(long, default_value_t = KittiTopics::default().cloud)]
    cloud_topic: String,
    /// Truth
    #[arg(long, default_value_t = KittiTopics::default().odometry)]
    odometry_topic: String,
    /// Side of the cells to whose means the scans are thinned, m
    #[arg(long, default_value_t = 0.3)]
    cell: f64,
    /// Give ours the thinned scan too, not all of its points
    #[arg(long)]
    thinned: bool,
    /// Threads
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Print kitti.json
    #[arg(long)]
    json: bool,
}

impl Kitti {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let report = lattice_lab::pool(self.threads)?.install(|| self.measure())?;
        let json = serde_json::to_string_pretty(&report)?;
        let table = kitti_report(&report);
        write_report(&table, &self.out)?;
        write_text(&self.out.join("kitti.json"), &json)?;
        match self.json {
            true => println!("{json}"),
            false => print!("{}", markdown(&table)),
        }
        Ok(())
    }

    fn measure(&self) -> Result<KittiReport, Box<dyn std::error::Error + Send + Sync>> {
        let topics = KittiTopics {
            cloud: self.cloud_topic.clone(),
            odometry: self.odometry_topic.clone(),
            ..KittiTopics::default()
        };
        let scans = read_scans(&self.bag, &topics)?;
        let prepare = |scan| Prepared::new(scan, self.cell);
        let prepared: Vec<Prepared> = scans.iter().map(prepare).collect::<Result<_, _>>()?;
        let pairs = pairs_of(&scans);
        let names: Vec<String> = scans.into_iter().map(|scan| scan.name).collect();
        write_scans(&self.out, &names, &prepared)?;
        let methods = KittiMethod::all(self.thinned);
        let bar = Progress::new("kitti");
        let mut rows: Vec<PairRow> = Vec::new();
        let total = 2 * methods.len() * pairs.len();
        for method in &methods {
            for known in [true, false] {
                for pair in &pairs {
                    bar.say(&method.name());
                    rows.extend(pair.run(method, known, &prepared));
                    bar.set(rows.len() as f64 / total.max(1) as f64);
                }
            }
        }
        bar.done();
        let points = prepared.iter();
        Ok(KittiReport {
            cell_m: self.cell,
            threads: rayon::current_num_threads(),
            right_m: RIGHT.m,
            right_deg: RIGHT.deg,
            points: points
                .map(|scan| [scan.whole.len(), scan.thinned.len()])
                .collect(),
            build: if cfg!(debug_assertions) {
                "dev"
            } else {
                "release"
            }
            .to_owned(),
            scans: names,
            pairs,
            rows,
        })
    }
}
