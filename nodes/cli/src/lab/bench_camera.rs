//! `lattice bench camera`: the node `semantic_cloud` at work, one line of result.

use clap::Args;
use lattice_lab::bench::{self, CameraSetup};

use crate::{CliResult, init_logging};

/// Options of `lattice bench camera`.
#[derive(Args)]
pub struct Camera {
    /// Width and height of the images
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [640, 480])]
    size: Vec<u32>,
    /// Images a second
    #[arg(long, default_value_t = 30.0)]
    rate_hz: f64,
    /// Images; ten more go before
    #[arg(long, default_value_t = 300)]
    count: u64,
    /// Network inside of the node, an ONNX file; without one the node is sent labels
    #[arg(long)]
    model: Option<String>,
    /// Parameter of the node, NAME:=VALUE
    #[arg(short, long = "param", value_name = "NAME:=VALUE")]
    param: Vec<String>,
    /// Print the result as one line of JSON
    #[arg(long)]
    json: bool,
}

impl Camera {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let [width, height] = self.size[..] else {
            return Err("--size takes a width and a height".into());
        };
        if u64::from(width) * u64::from(height) > 1 << 24 {
            return Err(format!("--size {width} {height} is more than 2^24 pixels").into());
        }
        let model = self.model.iter().map(|model| format!("model:={model}"));
        let report = bench::camera(&CameraSetup {
            size: [width, height],
            rate_hz: self.rate_hz,
            count: self.count,
            has_model: self.model.is_some(),
            params: model.chain(self.param.clone()).collect(),
        })?;
        if self.json {
            println!("{}", serde_json::to_string(&report)?);
            return Ok(());
        }
        println!(
            "{width} x {height} at {} Hz: {} clouds of {} images, {} points; from image to cloud {:.1} ms in the \
             median, {:.1} (p99); {:.2} cores for the node, {:.2} for the process",
            self.rate_hz,
            report.clouds,
            report.sent,
            report.points,
            report.median_ms,
            report.p99_ms,
            report.node_cores,
            report.process_cores
        );
        Ok(())
    }
}
