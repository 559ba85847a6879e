//! `lattice bag`: what is in logs, and damaged ones.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use lattice_bag::{BagReader, Recovered, recover};
use serde_json::{Value, json};

use crate::{CliResult, init_logging};

/// Look after rosbag2 logs
#[derive(Subcommand)]
pub enum Bag {
    /// Show topics, times and numbers of a log, also of one whose recorder was killed
    Info(Info),
    /// Write what can be read of a damaged log as a sound one, and say what is lost
    Recover(Recover),
}

/// Options of `lattice bag info`.
#[derive(Args)]
pub struct Info {
    /// rosbag2 directory, or an .mcap or .db3 file of one
    bag: PathBuf,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
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

impl Info {
    fn run(self) -> CliResult {
        let reader = BagReader::open(&self.bag)?;
        let (start_ns, end_ns) = (reader.start_ns(), reader.end_ns());
        let span_ns = end_ns.unwrap_or(0).saturating_sub(start_ns.unwrap_or(0));
        let duration_s = span_ns as f64 / 1e9;
        if self.json {
            let topics = reader.topics().iter().map(|topic| {
                json!({
                    "name": topic.name, "type": topic.type_name, "messages": topic.message_count,
                    "type_hash": topic.type_hash, "is_latched": topic.is_latched(),
                    "has_definition": topic.definition.is_some(),
                })
            });
            let info = json!({
                "messages": reader.message_count(), "start_ns": start_ns, "end_ns": end_ns,
                "duration_s": duration_s, "topics": topics.collect::<Vec<Value>>(),
            });
            println!("{}", serde_json::to_string_pretty(&info)?);
            return Ok(());
        }
        println!("{} messages, {duration_s:.3} s", reader.message_count());
        if let (Some(start_ns), Some(end_ns)) = (start_ns, end_ns) {
            println!("from {start_ns} to {end_ns} ns since 1970");
        }
        for topic in reader.topics() {
            let marks = match (topic.is_latched(), topic.definition.is_some()) {
                (true, true) => ", latched",
                (true, false) => ", latched, without definition",
                (false, true) => "",
                (false, false) => ", without definition",
            };
            let (count, name, of) = (topic.message_count, &topic.name, &topic.type_name);
            println!("{count:>9} {name} ({of}{marks})");
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
