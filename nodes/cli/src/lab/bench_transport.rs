//! `lattice bench transport`: two processes over loopback, one line of result.

use std::process::Command;

use clap::Args;
use lattice_lab::bench::{self, TransportSetup};

use crate::{CliResult, init_logging};

/// Options of `lattice bench transport`.
#[derive(Args)]
pub struct Transport {
    /// Bytes of points in a message
    #[arg(long, default_value_t = 2_000_000)]
    bytes: usize,
    /// Messages a second
    #[arg(long, default_value_t = 10.0)]
    rate_hz: f64,
    /// Messages
    #[arg(long, default_value_t = 300)]
    count: u64,
    /// Best effort in place of reliable
    #[arg(long)]
    best_effort: bool,
    /// Print the result as one line of JSON
    #[arg(long)]
    json: bool,
    /// Be the other process, in this domain
    #[arg(long, hide = true)]
    listen: Option<u16>,
}

impl Transport {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let setup = TransportSetup {
            bytes: self.bytes,
            rate_hz: self.rate_hz,
            count: self.count,
            best_effort: self.best_effort,
        };
        if let Some(domain) = self.listen {
            bench::listen(setup, domain)?;
            return Ok(());
        }
        let program = std::env::current_exe()?;
        let report = bench::send(setup, |domain| {
            let mut other = Command::new(program);
            let count = self.count.to_string();
            other.args(["bench", "transport", "--count", &count]);
            other.args(["--listen", &domain.to_string()]);
            if self.best_effort {
                other.arg("--best-effort");
            }
            other
        })?;
        if self.json {
            println!("{}", serde_json::to_string(&report)?);
            return Ok(());
        }
        let received = &report.received;
        println!(
            "{}: {} of {} messages of {} bytes at {} Hz; latency {:.2} ms (median), {:.2} (p99), \
             {:.2} (max); processor time {:.2} s sending, {:.2} s receiving",
            report.transport,
            received.heard,
            self.count,
            self.bytes,
            self.rate_hz,
            received.median_ms,
            received.p99_ms,
            received.max_ms,
            report.cpu_s,
            received.cpu_s,
        );
        Ok(())
    }
}
