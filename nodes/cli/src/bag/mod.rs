//! `lattice bag`: what is in logs, and damaged ones.

mod frames;
mod info;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use lattice_bag::{Recovered, recover};

use crate::{CliResult, init_logging};

/// Look after rosbag2 logs
#[derive(Subcommand)]
pub enum Bag {
    /// Show topics, rates, frames, times and size of a log, also of one whose recorder was killed
    Info(info::Info),
    /// Write what can be read of a damaged log as a sound one, and say what is lost
    Recover(Recover),
}

/// Options of `lattice bag recover`.
#[derive(Args)]
pub struct Recover {
    /// rosbag2 directory, or an .mcap or .db3 file of one
    bag: PathBuf,
    /// Directory of the new log, which must not be there yet
    #[arg(long, short)]
    out: PathBuf,
    /// Print what became of it as JSON
    #[arg(long)]
    json: bool,
}

impl Bag {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let command = match self {
            Bag::Info(command) => return command.run(),
            Bag::Recover(command) => command,
        };
        let recovered = recover(&command.bag, &command.out)?;
        if command.json {
            println!("{}", serde_json::to_string_pretty(&recovered)?);
        } else {
            print(&recovered);
        }
        Ok(())
    }
}

fn print(recovered: &Recovered) {
    println!("{} messages recovered", recovered.messages);
    if let Some(claimed) = recovered.claimed {
        let lost = claimed.saturating_sub(recovered.messages);
        println!("{lost} lost of {claimed} that its index or metadata count");
    }
    if recovered.refused > 0 {
        let refused = recovered.refused;
        println!("{refused} left out that are no messages or of no known topic");
    }
    for damage in &recovered.told {
        println!("damage: {damage}");
    }
    let untold = recovered
        .damages
        .saturating_sub(recovered.told.len() as u64);
    if untold > 0 {
        println!("{untold} more damages");
    }
}
