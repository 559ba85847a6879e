//! `lattice fleet map`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use lattice_fleet::Result;
use lattice_fleet::corrections::Corrections;
use lattice_fleet::engine::Engine;
use lattice_fleet::map_stage::{Task, Worker, run_all};
use lattice_fleet::replay_options::ReplayOptions;
use lattice_fleet::tables::Tables;
use serde::Serialize;

use crate::{cores, positive, program_lattice, progress};

/// Options of `lattice fleet map`.
#[derive(Args)]
pub struct Map {
    /// rosbag2 logs
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Folder of tables, created if needed
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Parameter files of the nodes; logs of one site need one origin (origin.mode: fixed)
    #[arg(long, value_name = "FILE")]
    params: Vec<PathBuf>,
    /// A parameter, as in `-p ins.source:=odometry`
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE")]
    param: Vec<String>,
    /// Lattice [default: of the parameters]
    #[arg(long)]
    lattice: Option<String>,
    /// Volume of one cell in m^3 [default: of the parameters]
    #[arg(long)]
    cell_volume: Option<f64>,
    /// Split each log by its time, one task for each slice
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    slice: Option<f64>,
    /// Corrections of poses, as `lattice fleet align` writes them; logs without an entry are mapped as they are
    #[arg(long, value_name = "FILE")]
    corrections: Option<PathBuf>,
    /// Concurrent tasks of the embedded engine; 0: one for each core
    #[arg(long, default_value_t = 0)]
    workers: usize,
    /// `embedded`, or a cluster: ballista://HOST:PORT
    #[arg(long, default_value = "embedded")]
    engine: Engine,
    /// The program lattice [default: beside this one, or on the PATH]. Executors of a cluster use their own
    #[arg(long, value_name = "PROGRAM")]
    program: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    tasks: usize,
    tasks_corrected: usize,
    parts_new: usize,
    parts_there: usize,
    failed: Vec<String>,
    wall_s: f64,
}

impl Map {
    /// Runs the command.
    pub fn run(self) -> Result {
        let begin = Instant::now();
        let tables = Tables::open_or_create(&self.out)?;
        let worker = Worker::new(program_lattice(self.program.clone()), None)?;
        let options = self.options()?;
        let corrections = self.corrections.as_deref().map(Corrections::read);
        let corrections = corrections.transpose()?;
        let bar = progress::bar("logs", self.logs.len() as u64);
        let (mut tasks, mut failed) = (Vec::new(), Vec::new());
        for log in &self.logs {
            let corrections = corrections.as_ref();
            match Task::of_log(log, self.slice, &options, corrections, &tables, &worker) {
                Ok(of_log) => tasks.extend(of_log),
                Err(error) => failed.push(format!("{}: {error}", log.display())),
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        // A log without tasks counts as one that failed.
        let all = tasks.len() + failed.len();
        let tasks_corrected = tasks.iter().filter(|task| task.corrected).count();
        // A log that is given twice is one task.
        tasks.sort_by_key(|task| task.source.part_name());
        tasks.dedup_by_key(|task| task.source.part_name());
        let mut todo = Vec::new();
        for task in tasks {
            if !task.is_done()? {
                todo.push(task);
            }
        }
        let bar = progress::bar("map", todo.len() as u64);
        let threads = if self.workers == 0 {
            cores()
        } else {
            self.workers
        };
        let show = |ended: usize| bar.set_position(ended as u64);
        let (parts_new, failures) = match &self.engine {
            Engine::Embedded => run_all(&todo, &worker, threads, &show),
            #[cfg(feature = "ballista")]
            Engine::Ballista(place) => {
                crate::block_on(cores(), lattice_fleet::cluster::map(place, &todo))?
            }
            #[cfg(not(feature = "ballista"))]
            Engine::Ballista(_) => {
                return Err("this lattice-fleet was built without the feature ballista".into());
            }
        };
        bar.finish_and_clear();
        failed.extend(failures);
        let report = Report {
            tasks: all,
            tasks_corrected,
            parts_new,
            parts_there: all.saturating_sub(parts_new + failed.len()),
            wall_s: begin.elapsed().as_secs_f64(),
            failed,
        };
        self.print(&report)
    }

    fn options(&self) -> Result<ReplayOptions> {
        let params = self
            .params
            .iter()
            .map(|path| ReplayOptions::read_params(path));
        Ok(ReplayOptions {
            params: params.collect::<Result<_>>()?,
            param: self.param.clone(),
            lattice: self.lattice.clone(),
            cell_volume_m3: self.cell_volume,
        })
    }

    fn print(&self, report: &Report) -> Result {
        if self.json {
            println!("{}", serde_json::to_string_pretty(report)?);
        } else {
            println!(
                "{} tasks, {} of them with corrected poses: {} new parts, {} there already, {} failed, {:.1} s",
                report.tasks,
                report.tasks_corrected,
                report.parts_new,
                report.parts_there,
                report.failed.len(),
                report.wall_s
            );
        }
        match &report.failed[..] {
            [] => Ok(()),
            failed => Err(format!(
                "{} of {} tasks failed:\n  {}",
                failed.len(),
                report.tasks,
                failed.join("\n  ")
            )
            .into()),
        }
    }
}
