//! `lattice demo`: from a simulated log to maps of all lattices, through real nodes.

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
use std::path::PathBuf;

/// Parameters of the simulated machine, for users to copy.
const BOBCAT_PARAMS: &str = include_str!("../../../../params/bobcat.yaml");
/// Parameters of the viewer.
#[cfg(feature = "viewer")]
const VIEWER_PARAMS: &str = include_str!("../../../../params/viewer.yaml");

/// Simulate, play, map
#[derive(Args)]
pub struct Demo {
    /// Directory for the log and the maps
    #[arg(long, default_value = "target/lattice_demo")]
    out: PathBuf,
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
        let bag = self.out.join("log");
        let params = self.out.join("bobcat.yaml");
        fs::create_dir_all(&self.out).map_err(|e| format!("{}: {e}", self.out.display()))?;
        write_text(&params, BOBCAT_PARAMS)?;
        let (params, viewer) = self.viewer(params)?;
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
        let png = self.out.join("map.png");
        let direct = Replay {
            direct: true,
            lattice: Some(Lattices(vec![LatticeKind::Fcc])),
            map_out: Some(self.out.join("map.lattice")),
            ..replay
        };
        direct.replay()?;
        let (map, _) = crate::map::read(&self.out.join("map.lattice"))?;
        picture(&map.into_list(usize::MAX), &RenderOptions::default(), &png)?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            println!("{report}");
            println!(
                "log {}, picture {}",
                self.out.join("log").display(),
                png.display()
            );
        }
        #[cfg(feature = "viewer")]
        if viewer.is_some() && std::io::stdout().is_terminal() {
            // The nodes have ended: the page goes on with the map that they made.
            let address = (Ipv4Addr::LOCALHOST, self.port).into();
            let (_server, url) = crate::view::serve_file(&self.out.join("map.lattice"), address)?;
            println!("the map stays at {url} until Ctrl-C");
            loop {
                std::thread::park();
            }
        }
        Ok(())
    }

    /// Files of parameters, and the port of the viewer if there is to be one.
    #[cfg(feature = "viewer")]
    fn viewer(&self, params: PathBuf) -> CliResult<(Vec<PathBuf>, Option<u16>)> {
        if self.no_view {
            return Ok((vec![params], None));
        }
        let viewer = self.out.join("viewer.yaml");
        write_text(&viewer, VIEWER_PARAMS)?;
        let is_free = TcpListener::bind((Ipv4Addr::LOCALHOST, self.port)).is_ok();
        let port = if is_free { self.port } else { 0 };
        Ok((vec![params, viewer], Some(port)))
    }

    #[cfg(not(feature = "viewer"))]
    fn viewer(&self, params: PathBuf) -> CliResult<(Vec<PathBuf>, Option<u16>)> {
        Ok((vec![params], None))
    }
}
