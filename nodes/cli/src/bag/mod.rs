//! `lattice bag`: inspection, conversion and recovery of logs.

mod frames;
mod info;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use lattice_bag::{Converted, Recovered, Unchecked, convert, recover};

use crate::{CliResult, init_logging};

/// Inspect, convert and recover logs
#[derive(Subcommand)]
pub enum Bag {
    /// Show topics, rates, frames, times and size of a log, even if its recorder was killed
    Info(info::Info),
    /// Write a log of ROS 1 (.bag) as a rosbag2 log (MCAP), for all tools of ROS 2
    Convert(Convert),
    /// Copy the readable part of a damaged log to a new log, and report the losses
    Recover(Recover),
}

/// Options of `lattice bag convert`.
#[derive(Args)]
pub struct Convert {
    /// ROS 1 bag, finished or not, a directory of split ones, or any other log
    bag: PathBuf,
    /// Directory of the new log, which must not exist
    #[arg(long, short)]
    out: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Options of `lattice bag recover`.
#[derive(Args)]
pub struct Recover {
    /// rosbag2 directory, an .mcap or .db3 file of one, or a ROS 1 bag
    bag: PathBuf,
    /// Directory of the new log, which must not exist
    #[arg(long, short)]
    out: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

impl Bag {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let command = match self {
            Bag::Info(command) => return command.run(),
            Bag::Convert(command) => return command.run(),
            Bag::Recover(command) => command,
        };
        let recovered = recover(&command.bag, &command.out)?;
        if command.json {
            println!("{}", serde_json::to_string_pretty(&recovered)?);
        } else {
            print(&recovered);
        }
        if recovered.is_nothing() {
            let bag = command.bag.display();
            return Err(format!("{bag}: nothing can be recovered; take another copy").into());
        }
        Ok(())
    }
}

impl Convert {
    fn run(self) -> CliResult {
        let converted = convert(&self.bag, &self.out)?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&converted)?);
            return Ok(());
        }
        let Converted {
            messages, topics, ..
        } = converted;
        println!("{messages} messages of {topics} topics converted");
        for reason in &converted.left_out {
            println!("left out: {reason}");
        }
        for cut in &converted.cuts {
            println!("cut: {cut}");
        }
        Ok(())
    }
}

fn print(recovered: &Recovered) {
    println!("{} messages recovered", recovered.messages);
    match (recovered.lost, recovered.claimed) {
        (Some(0), _) if recovered.damages == 0 => println!("0 lost"),
        (Some(0), Some(all)) => println!("as many as its metadata or index counts ({all})"),
        (Some(lost), Some(all)) => {
            println!("{lost} lost of {all} that its metadata or index counts");
        }
        _ => println!("unknown how many are lost: neither metadata.yaml nor an index counts them"),
    }
    for Unchecked {
        topic,
        log_times_ns,
    } in &recovered.unchecked
    {
        let span = log_times_ns.iter().min().zip(log_times_ns.iter().max());
        let (first_ns, last_ns) = span.unwrap_or((&0, &0));
        println!(
            "{} on {topic} unchecked, from {first_ns} to {last_ns} ns: their checksum is wrong, and some may be \
             altered (--json lists them)",
            log_times_ns.len()
        );
    }
    if recovered.refused > 0 {
        let refused = recovered.refused;
        println!("{refused} skipped: invalid messages, or of an unknown topic");
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
