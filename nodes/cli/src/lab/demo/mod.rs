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
use crate::replay::{Replay, map_file};
use crate::{CliResult, Lattices, init_logging};
use clap::Args;
use lattice_bag::Storage;
use lattice_core::lattice::LatticeKind;
use lattice_lab::datasets::BobcatOptions;
use lattice_lab::render::RenderOptions;
use lattice_nodes::files::atomic_write::write_text;
use std::fs::{self, File, TryLockError};
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
///
/// A page shows the map as it grows. In a terminal it stays with the last map until Ctrl-C; in a pipe, with --json
/// and with --no-view the demo ends with its table.
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
    /// Directory for the log and the maps [default: lattice_demo, indoors lattice_demo_indoor]
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
    /// Do without the page that shows the FCC map, or the first, as it grows, and end with the table
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
        let (out, _lock) = self.out("lattice_demo")?;
        let bag = out.join("log");
        let params = out.join("bobcat.yaml");
        write_text(&params, BOBCAT_PARAMS)?;
        let (params, viewer) = self.viewer(&out, params)?;
        let maps = out.join("map.lattice");
        let map = self.shown_map(&maps);
        // Of a demo before, which may have been another.
        let _ = fs::remove_file(&map);
        let summary = simulate::bobcat(&BobcatOptions {
            seed: self.seed,
            duration_s: self.duration,
            begin_s: 0.0,
            person: false,
            scans: false,
            ins_offset: [0.0; 4],
            storage: Storage::Mcap,
            out: bag.clone(),
            overwrite: true,
        })?;
        eprintln!("{summary}");
        let replay = Replay {
            bag,
            lattice: Some(self.lattice.clone()),
            params,
            rate: self.rate,
            map_out: Some(maps),
            json: self.json,
            viewer,
            ..Replay::default()
        };
        let report = replay.replay()?;
        report.check()?;
        // The nodes have ended: the page goes on with the map that they made.
        #[cfg(feature = "viewer")]
        let page = match viewer.filter(|_| self.page_stays()) {
            Some(port) => Some(crate::view::serve_file(
                &map,
                (Ipv4Addr::LOCALHOST, port).into(),
            )?),
            None => None,
        };
        let png = out.join("map.png");
        let (list, _) = crate::map::read(&map)?;
        picture(&list.into_list(usize::MAX), &RenderOptions::default(), &png)?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            println!("{report}");
            println!(
                "log {}, map {}, picture {}",
                out.join("log").display(),
                map.display(),
                png.display()
            );
        }
        #[cfg(feature = "viewer")]
        if let Some((_server, url)) = page {
            println!("the page stays at {url} with this map; Ctrl-C ends it");
            loop {
                std::thread::park();
            }
        }
        Ok(())
    }

    /// The directory, made and kept from other demos.
    fn out(&self, usual: &str) -> CliResult<(PathBuf, File)> {
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from(usual));
        let named = |problem: &dyn std::fmt::Display| format!("{}: {problem}", out.display());
        fs::create_dir_all(&out).map_err(|e| named(&e))?;
        let lock = File::open(&out).map_err(|e| named(&e))?;
        if let Err(TryLockError::WouldBlock) = lock.try_lock() {
            let problem = "another demo is writing there; give this one a folder with --out";
            return Err(named(&problem).into());
        }
        Ok((out, lock))
    }

    /// The map that is shown: FCC, or else the first.
    fn shown_map(&self, maps: &Path) -> PathBuf {
        let kinds = &self.lattice.0;
        let fcc = kinds.iter().find(|kind| **kind == LatticeKind::Fcc);
        match fcc.or(kinds.first()) {
            Some(kind) => map_file(maps, *kind, kinds.len() > 1),
            None => maps.to_owned(),
        }
    }

    /// True if the report goes to a terminal.
    #[cfg(feature = "viewer")]
    fn page_stays(&self) -> bool {
        !self.json && std::io::stdout().is_terminal()
    }

    #[cfg(feature = "headset")]
    fn run_indoor(&self) -> CliResult {
        let (out, _lock) = self.out("lattice_demo_indoor")?;
        let model = match self.true_labels {
            true => None,
            false => Some(network::model(self.model.as_ref(), &out)?),
        };
        #[cfg(feature = "viewer")]
        let (viewer, page_stays) = match self.no_view {
            true => (None, false),
            false => (Some(self.port()?), self.page_stays()),
        };
        #[cfg(not(feature = "viewer"))]
        let (viewer, page_stays) = (None, false);
        let demo = indoor::IndoorDemo {
            out,
            seed: self.seed,
            rate: self.rate,
            views: self.views,
            model,
            viewer,
            page_stays,
            json: self.json,
        };
        demo.run()
    }

    /// The port that was asked for, or one that is free if it is taken.
    #[cfg(feature = "viewer")]
    fn port(&self) -> CliResult<u16> {
        let bind = |port| TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let free = bind(self.port).or_else(|_| bind(0))?;
        Ok(free.local_addr()?.port())
    }

    /// Files of parameters, and the port of the viewer if there is to be one.
    #[cfg(feature = "viewer")]
    fn viewer(&self, out: &Path, params: PathBuf) -> CliResult<(Vec<PathBuf>, Option<u16>)> {
        if self.no_view {
            return Ok((vec![params], None));
        }
        let viewer = out.join("viewer.yaml");
        write_text(&viewer, VIEWER_PARAMS)?;
        Ok((vec![params, viewer], Some(self.port()?)))
    }

    #[cfg(not(feature = "viewer"))]
    fn viewer(&self, _out: &Path, params: PathBuf) -> CliResult<(Vec<PathBuf>, Option<u16>)> {
        Ok((vec![params], None))
    }
}
