//! `lattice demo`: from a simulated log to maps of all lattices, through real nodes.

#[cfg(feature = "headset")]
mod indoor;
#[cfg(feature = "headset")]
mod indoor_report;
#[cfg(feature = "headset")]
mod indoor_results;
#[cfg(feature = "headset")]
mod network;

use super::{picture, simulate};
use crate::replay::Replay;
use crate::{CliResult, Lattices, init_logging};
use clap::Args;
use lattice_bag::Storage;
use lattice_core::lattice::LatticeKind;
use lattice_lab::datasets::BobcatOptions;
use lattice_lab::render::RenderOptions;
use lattice_nodes::files::whole::write_text;
use std::fs;
#[cfg(feature = "viewer")]
use std::io::IsTerminal;
#[cfg(feature = "viewer")]
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};

/// Parameters of the simulated machine, for users to copy.
const BOBCAT_PARAMS: &str = include_str!("../../../../../params/bobcat.yaml");
/// Parameters of the viewer.
#[cfg(feature = "viewer")]
const VIEWER_PARAMS: &str = include_str!("../../../../../params/viewer.yaml");

/// Simulate, play, map
#[derive(Args)]
pub struct Demo {
    /// A robot with a depth camera surveys a house, and a headset joins it
    #[cfg(feature = "headset")]
    #[arg(long, conflicts_with_all = ["duration", "lattice"])]
    indoor: bool,
    /// Indoors: images of true labels in place of a network on images of colours
    #[cfg(feature = "headset")]
    #[arg(long, requires = "indoor")]
    true_labels: bool,
    /// Indoors: another network, an ONNX file
    #[cfg(feature = "headset")]
    #[arg(
        long,
        requires = "indoor",
        conflicts_with = "true_labels",
        value_name = "ONNX"
    )]
    model: Option<PathBuf>,
    /// Indoors: views of the robot
    #[cfg(feature = "headset")]
    #[arg(long, requires = "indoor", default_value_t = 240)]
    views: usize,
    /// Directory for the log and the maps [default: target/lattice_demo, indoors target/lattice_demo_indoor]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Seed of the simulation
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the log in s
    #[arg(long, default_value_t = 20.0)]
    duration: f64,
    /// Speed of the log, 1 is real time
    #[arg(long, default_value_t = 1.0)]
    rate: f64,
    /// cubic, bcc, fcc, mcc, hex, hexopt, several with commas (five at most), or paper
    #[arg(long, default_value = "paper")]
    lattice: Lattices,
    /// Do without the page that shows the FCC map, or the first, as it grows
    #[cfg(feature = "viewer")]
    #[arg(long)]
    no_view: bool,
    /// Port of this page; one that is free if it is taken
    #[cfg(feature = "viewer")]
    #[arg(long, default_value_t = 8765)]
    port: u16,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

impl Demo {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        #[cfg(feature = "headset")]
        if self.indoor {
            return self.run_indoor();
        }
        let out = self.out("target/lattice_demo")?;
        let bag = out.join("log");
        let params = out.join("bobcat.yaml");
        write_text(&params, BOBCAT_PARAMS)?;
        let (params, viewer) = self.viewer(&out, params)?;
        let summary = simulate::bobcat(&BobcatOptions {
            seed: self.seed,
            duration_s: self.duration,
            begin_s: 0.0,
            person: false,
            ins_offset: [0.0; 4],
            storage: Storage::Mcap,
            out: bag.clone(),
            overwrite: true,
        })?;
        eprintln!("{summary}");
        let replay = Replay {
            bag,
            direct: false,
            lattice: Some(self.lattice.clone()),
            params,
            rate: self.rate,
            json: self.json,
            viewer,
            ..Replay::default()
        };
        let report = replay.replay()?;
        // The same log without DDS: the map that the nodes should have made, and its picture.
        let png = out.join("map.png");
        let direct = Replay {
            direct: true,
            lattice: Some(Lattices(vec![LatticeKind::Fcc])),
            map_out: Some(out.join("map.lattice")),
            ..replay
        };
        direct.replay()?;
        let (map, _) = crate::map::read(&out.join("map.lattice"))?;
        picture(&map.into_list(usize::MAX), &RenderOptions::default(), &png)?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            println!("{report}");
            println!(
                "log {}, picture {}",
                out.join("log").display(),
                png.display()
            );
        }
        #[cfg(feature = "viewer")]
        if viewer.is_some() && std::io::stdout().is_terminal() {
            // The nodes have ended: the page goes on with the map that they made.
            let address = (Ipv4Addr::LOCALHOST, self.port).into();
            let (_server, url) = crate::view::serve_file(&out.join("map.lattice"), address)?;
            println!("the map stays at {url} until Ctrl-C");
            loop {
                std::thread::park();
            }
        }
        Ok(())
    }

    /// The directory, made.
    fn out(&self, usual: &str) -> CliResult<PathBuf> {
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from(usual));
        fs::create_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
        Ok(out)
    }

    #[cfg(feature = "headset")]
    fn run_indoor(&self) -> CliResult {
        let out = self.out("target/lattice_demo_indoor")?;
        let model = match self.true_labels {
            true => None,
            false => Some(network::model(self.model.as_ref(), &out)?),
        };
        #[cfg(feature = "viewer")]
        let viewer = (!self.no_view).then(|| self.port());
        #[cfg(not(feature = "viewer"))]
        let viewer = None;
        let demo = indoor::IndoorDemo {
            out,
            seed: self.seed,
            rate: self.rate,
            views: self.views,
            model,
            viewer,
            json: self.json,
        };
        demo.run()
    }

    /// The port that was asked for, or 0 if it is taken.
    #[cfg(feature = "viewer")]
    fn port(&self) -> u16 {
        let is_free = TcpListener::bind((Ipv4Addr::LOCALHOST, self.port)).is_ok();
        if is_free { self.port } else { 0 }
    }

    /// Files of parameters, and the port of the viewer if there is to be one.
    #[cfg(feature = "viewer")]
    fn viewer(&self, out: &Path, params: PathBuf) -> CliResult<(Vec<PathBuf>, Option<u16>)> {
        if self.no_view {
            return Ok((vec![params], None));
        }
        let viewer = out.join("viewer.yaml");
        write_text(&viewer, VIEWER_PARAMS)?;
        Ok((vec![params, viewer], Some(self.port())))
    }

    #[cfg(not(feature = "viewer"))]
    fn viewer(&self, _out: &Path, params: PathBuf) -> CliResult<(Vec<PathBuf>, Option<u16>)> {
        Ok((vec![params], None))
    }
}

/// Leaves a page up until Ctrl-C where somebody looks at a terminal.
#[cfg(all(feature = "headset", feature = "viewer"))]
fn stay(viewer: Option<crate::replay::node_process::NodeProcess>) -> CliResult {
    if viewer.is_some() && std::io::stdout().is_terminal() {
        println!("the page stays until Ctrl-C");
        loop {
            std::thread::park();
        }
    }
    Ok(())
}

#[cfg(all(feature = "headset", not(feature = "viewer")))]
fn stay(_viewer: Option<crate::replay::node_process::NodeProcess>) -> CliResult {
    Ok(())
}
