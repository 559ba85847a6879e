//! `lattice bench segment`.

use crate::CliResult;
use clap::Args;
use lattice_lab::bench;
use lattice_nodes::segmenter::{Backend, Size, read_network_by};
use std::path::PathBuf;

/// Options of `lattice bench segment`.
#[derive(Args)]
pub struct Segment {
    /// Network, an ONNX file
    #[arg(long)]
    model: PathBuf,
    /// Width and height of its input, where the file leaves them open
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"])]
    input_size: Option<Vec<usize>>,
    /// Library that runs it: tract, or ort where the program has it
    #[arg(long, default_value = "tract", value_parser = backend)]
    backend: Backend,
    /// Measured runs; one more goes before
    #[arg(long, default_value_t = 10)]
    rounds: usize,
    /// Threads of the network
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Print the result as one line of JSON
    #[arg(long)]
    json: bool,
}

fn backend(name: &str) -> Result<Backend, String> {
    let found = Backend::ALL.iter().find(|(known, _)| *known == name);
    let expected = "expected tract or ort".to_owned();
    found.map(|(_, backend)| *backend).ok_or(expected)
}

impl Segment {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let size = self.input_size.and_then(|size| match size[..] {
            [width, height] => Some(Size { width, height }),
            _ => None,
        });
        let network = read_network_by(self.backend, &self.model, size, self.threads.into())?;
        let report = bench::segment(network.as_ref(), self.rounds)?;
        if self.json {
            println!("{}", serde_json::to_string(&report)?);
            return Ok(());
        }
        let median_ms = |times: &[f64]| {
            let mut times = times.to_vec();
            times.sort_by(f64::total_cmp);
            1e3 * times.get(times.len() / 2).copied().unwrap_or_default()
        };
        let ([width, height], [columns, rows]) = (report.input, report.output);
        println!(
            "{width} x {height} to {columns} x {rows}, {} threads: {:.1} ms in the median, {:.1} ms of processor time",
            self.threads,
            median_ms(&report.wall),
            median_ms(&report.cpu)
        );
        Ok(())
    }
}
