//! `lattice fleet serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use lattice_fleet::Result;
use lattice_fleet::cluster::{ExecutorOptions, check_address, executor, scheduler};
use lattice_fleet::map_stage::Worker;
use lattice_fleet::roots::Roots;
use lattice_fleet::stop::Scratch;

use crate::{block_on, cores, program_lattice};

/// Processes of a Ballista cluster. There is neither encryption nor authentication: whoever reaches their ports can
/// run queries and tasks over the files below the roots.
#[derive(Subcommand)]
pub enum Serve {
    /// Run the scheduler, to which drivers and executors connect
    Scheduler(Scheduler),
    /// Run an executor; it needs logs and tables at the same paths as the driver, and the program lattice
    Executor(Executor),
}

/// Options of `lattice fleet serve scheduler`.
#[derive(Args)]
pub struct Scheduler {
    /// Address to listen at
    #[arg(long, default_value = "127.0.0.1:50050")]
    address: SocketAddr,
    /// Folder of logs and tables; no other file is read. May be given several times
    #[arg(long, required = true, value_name = "DIR")]
    root: Vec<PathBuf>,
    /// Allow an address beyond this machine, without encryption and authentication
    #[arg(long)]
    insecure: bool,
    /// Seconds without a heartbeat after which the tasks of an executor are given to others
    #[arg(long, default_value_t = 20, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(4..))]
    executor_timeout: u64,
}

/// Options of `lattice fleet serve executor`.
#[derive(Args)]
pub struct Executor {
    /// Host and port of the scheduler
    #[arg(long, default_value = "127.0.0.1:50050", value_parser = place)]
    scheduler: (String, u16),
    /// Address to listen at; the next port is used too
    #[arg(long, default_value = "127.0.0.1:50051")]
    address: SocketAddr,
    /// Folder of logs and tables; no other file is read or written. May be given several times
    #[arg(long, required = true, value_name = "DIR")]
    root: Vec<PathBuf>,
    /// Allow addresses beyond this machine, without encryption and authentication
    #[arg(long)]
    insecure: bool,
    /// The program lattice, which maps logs [default: beside this one, or on the PATH]
    #[arg(long, value_name = "PROGRAM")]
    program: Option<PathBuf>,
    /// Concurrent tasks; 0: one for each core
    #[arg(long, default_value_t = 0)]
    slots: usize,
    /// Folder for shuffle files [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
}

impl Serve {
    /// Runs the command.
    pub fn run(self) -> Result {
        let temporary = Scratch::create(&std::env::temp_dir(), "lattice-fleet-")?;
        match self {
            Self::Scheduler(options) => {
                check_address(&options.address, options.insecure)?;
                let roots = Roots::new(&options.root)?;
                let timeout_s = options.executor_timeout;
                let scheduler = scheduler(options.address, timeout_s, &roots, temporary.path());
                block_on(cores(), scheduler)
            }
            Self::Executor(options) => {
                check_address(&options.address, options.insecure)?;
                let roots = Roots::new(&options.root)?;
                let work = options.work.unwrap_or_else(|| temporary.path().to_owned());
                let options = ExecutorOptions {
                    scheduler: options.scheduler,
                    address: options.address,
                    slots: if options.slots == 0 {
                        cores()
                    } else {
                        options.slots
                    },
                    work_folder: work,
                    is_insecure: options.insecure,
                    worker: Worker::new(program_lattice(options.program), Some(roots.clone()))?,
                    roots,
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
