//! `lattice fleet map`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use lattice_fleet::Result;
use lattice_fleet::corrections::Corrections;
use lattice_fleet::engine::Engine;
use lattice_fleet::map_stage::{Settings, Task, run_all};
use lattice_fleet::tables::Tables;
use serde::Serialize;

use crate::{cores, positive, program_lattice, progress};

/// Options of `lattice fleet map`.
#[derive(Args)]
pub struct Map {
    /// rosbag2 logs
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Folder of tables, made if it is not there
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Parameter files of the nodes; logs of one site need one origin (ins.origin.mode: fixed)
    #[arg(long, value_name = "FILE")]
    params: Vec<PathBuf>,
    /// One parameter, as in `-p ins.source:=odometry`
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE")]
    param: Vec<String>,
    /// Lattice [default: of the parameters]
    #[arg(long)]
    lattice: Option<String>,
    /// Volume of one cell in m^3 [default: of the parameters]
    #[arg(long)]
    cell_volume: Option<f64>,
    /// Part each log by its time, a task for each slice
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    slice: Option<f64>,
    /// Corrections of poses, as `lattice fleet align` writes them; logs without an entry are mapped as they are
    #[arg(long, value_name = "FILE")]
    corrections: Option<PathBuf>,
    /// Tasks at a time in this process; 0: one for each core
    #[arg(long, default_value_t = 0)]
    workers: usize,
    /// `embedded`, or a cluster: ballista://HOST:PORT
    #[arg(long, default_value = "embedded")]
    engine: Engine,
    /// The program lattice [default: beside this one, or on the PATH]
    #[arg(long, value_name = "PROGRAM")]
    program: Option<PathBuf>,
    /// Print the figures as JSON
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
        let settings = self.settings();
        let corrections = self.corrections.as_deref().map(Corrections::read);
        let corrections = corrections.transpose()?;
        let bar = progress::bar("logs", self.logs.len() as u64);
        let (mut tasks, mut failed) = (Vec::new(), Vec::new());
        for log in &self.logs {
            match Task::of_log(log, self.slice, &settings, corrections.as_ref(), &tables) {
                Ok(of_log) => tasks.extend(of_log),
                Err(error) => failed.push(format!("{}: {error}", log.display())),
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        let all = tasks.len();
        let tasks_corrected = tasks.iter().filter(|task| task.corrected).count();
        // Twice the same log is one task.
        tasks.sort_by_key(|task| task.source.part_name());
        tasks.dedup_by_key(|task| task.source.part_name());
        let mut todo = Vec::new();
        for task in tasks {
            if !task.is_done()? {
                todo.push(task);
            }
        }
        let bar = progress::bar("map", todo.len() as u64);
        let workers = if self.workers == 0 {
            cores()
        } else {
            self.workers
        };
        let tell = |ended: usize| bar.set_position(ended as u64);
        let (parts_new, failures) = match &self.engine {
            Engine::Embedded => run_all(&todo, workers, &tell),
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
        self.tell(&report)
    }

    fn settings(&self) -> Settings {
        let mut options = Vec::new();
        for param in &self.param {
            options.extend(["-p".to_owned(), param.clone()]);
        }
        if let Some(lattice) = &self.lattice {
            options.extend(["--lattice".to_owned(), lattice.clone()]);
        }
        if let Some(volume_m3) = self.cell_volume {
            options.extend(["--cell-volume".to_owned(), volume_m3.to_string()]);
        }
        Settings {
            program: program_lattice(self.program.clone()),
            params: self.params.clone(),
            options,
            threads: 1,
        }
    }

    fn tell(&self, report: &Report) -> Result {
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
