//! `lattice fleet serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use lattice_fleet::Result;
use lattice_fleet::cluster::{ExecutorOptions, executor, scheduler};

use crate::{block_on, cores};

/// A process of a Ballista cluster. Whoever reaches its ports can run queries and read files: keep them
/// in a network of your own.
#[derive(Subcommand)]
pub enum Serve {
    /// The scheduler, which drivers and executors call
    Scheduler(Scheduler),
    /// An executor; it needs the tables and the logs at the same paths, and the program lattice
    Executor(Executor),
}

/// Options of `lattice fleet serve scheduler`.
#[derive(Args)]
pub struct Scheduler {
    /// Address to listen at
    #[arg(long, default_value = "127.0.0.1:50050")]
    address: SocketAddr,
    /// Seconds of silence after which an executor counts as lost and its tasks go to others
    #[arg(long, default_value_t = 20, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(4..))]
    executor_timeout: u64,
}

/// Options of `lattice fleet serve executor`.
#[derive(Args)]
pub struct Executor {
    /// Host and port of the scheduler
    #[arg(long, default_value = "127.0.0.1:50050", value_parser = place)]
    scheduler: (String, u16),
    /// Address to listen at; the port behind it is taken too
    #[arg(long, default_value = "127.0.0.1:50051")]
    address: SocketAddr,
    /// Tasks at a time; 0: one for each core
    #[arg(long, default_value_t = 0)]
    slots: usize,
    /// Folder for what it shuffles [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
}

impl Serve {
    /// Runs the command.
    pub fn run(self) -> Result {
        match self {
            Self::Scheduler(options) => block_on(
                cores(),
                scheduler(options.address, options.executor_timeout),
            ),
            Self::Executor(options) => {
                let temporary = tempfile::tempdir()?;
                let work = options.work.unwrap_or_else(|| temporary.path().to_owned());
                let options = ExecutorOptions {
                    scheduler: options.scheduler,
                    address: options.address,
                    slots: if options.slots == 0 {
                        cores()
                    } else {
                        options.slots
                    },
                    work_folder: work.display().to_string(),
                };
                block_on(cores(), executor(options))
            }
        }
    }
}

fn place(text: &str) -> std::result::Result<(String, u16), String> {
    let parts = text.rsplit_once(':');
    let parts = parts.and_then(|(host, port)| Some((host.to_owned(), port.parse().ok()?)));
    parts.ok_or_else(|| format!("{text:?} is not HOST:PORT"))
}
