//! `lattice fleet align`.

use std::path::PathBuf;

use clap::Args;
use lattice_fleet::Result;
use lattice_fleet::align::{AlignOptions, align, count_logs};
use lattice_fleet::corrections::{Action, Correction};
use lattice_fleet::files::write_json;
use lattice_fleet::tables::Tables;

use crate::{not_negative, positive, program_lattice, progress};

/// Options of `lattice fleet align`.
#[derive(Args)]
pub struct Align {
    /// Folder of tables with the logs to align, mapped without corrections
    tables: PathBuf,
    /// Folder of the reference, a merged map without these logs, such as site/merged
    #[arg(long, value_name = "DIR")]
    against: PathBuf,
    /// File for the corrections, JSON; `lattice fleet map --corrections` takes it
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Sensor of the logs, as of `lattice calibrate`: lidar, headset or depth_camera
    #[arg(long, default_value = "lidar")]
    profile: String,
    /// Largest move, m; a log that would move farther is left out. It bounds the search too
    #[arg(long, default_value_t = 5.0, value_name = "M", value_parser = positive)]
    max_move: f64,
    /// Largest rotation, degrees; a log that would turn more is left out. It bounds the search too
    #[arg(long, default_value_t = 5.0, value_name = "DEG", value_parser = positive)]
    max_turn: f64,
    /// Smallest move, m; a log that would move less is kept [default: a quarter of the cell size]
    #[arg(long, value_name = "M", value_parser = not_negative)]
    min_move: Option<f64>,
    /// The program lattice [default: beside this one, or on the PATH]
    #[arg(long, value_name = "PROGRAM")]
    program: Option<PathBuf>,
    /// Print the corrections as JSON
    #[arg(long)]
    json: bool,
}

impl Align {
    /// Runs the command.
    pub fn run(self) -> Result {
        let tables = Tables::open(&self.tables)?;
        let options = AlignOptions {
            program: program_lattice(self.program),
            profile: self.profile,
            max_move_m: self.max_move,
            max_turn_deg: self.max_turn,
            min_move_m: self.min_move,
        };
        let bar = progress::bar("align", count_logs(&tables)? as u64);
        let mut show = |done: usize| bar.set_position(done as u64);
        let corrections = align(&tables, &self.against, &options, &mut show)?;
        bar.finish_and_clear();
        write_json(&self.out, &corrections)?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&corrections)?);
            return Ok(());
        }
        for entry in &corrections.logs {
            println!("{}", line(entry));
        }
        let count = |action| {
            let of_it = corrections.logs.iter().filter(|log| log.action == action);
            of_it.count()
        };
        let (moved, kept) = (count(Action::Move), count(Action::Keep));
        println!(
            "{} logs: {moved} to move, {kept} to keep, {} to leave out; apply it by `lattice fleet map --corrections {}`",
            corrections.logs.len(),
            count(Action::LeaveOut),
            self.out.display()
        );
        Ok(())
    }
}

fn line(entry: &Correction) -> String {
    let found = entry.found.as_ref();
    let figures = found.map_or_else(String::new, |found| {
        format!(
            "{:>7.3} m {:>6.3} deg, {}: ",
            found.largest_move_m, found.turn_deg, found.verdict
        )
    });
    let action = match entry.action {
        Action::Move => "move",
        Action::Keep => "keep",
        Action::LeaveOut => "leave out",
    };
    format!("{action:<9} {}  {figures}{}", entry.log, entry.reason)
}
