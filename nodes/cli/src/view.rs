//! `lattice view`: a map in the browser.

use std::io::IsTerminal;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use clap::Args;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::label_names::LabelNames;
use lattice_nodes::files::points::{PointFileOptions, is_named_as_points};
use lattice_nodes::lattice_mapper::cube_m3;
use lattice_nodes::viewer_server::{self, Access, Tls, ViewerOptions};

use super::CliResult;
use crate::cell_size::CellSize;
use crate::points::{Columns, Points};
use crate::run::Run;

/// Show a map in the browser: a map file, a point file, a log, or a live map
#[derive(Args)]
pub struct View {
    /// A map file; a point file (ply, pcd, las, laz, e57, bt, xyz, txt, csv or KITTI bin, also .bz2), which is quantized
    /// first, with an automatic cell size unless one is given; a rosbag2 log, which is mapped
    /// first; or parameter files, whose nodes are run with the viewer. By default the live map on this ROS
    /// domain
    what: Vec<PathBuf>,
    #[command(flatten)]
    cells: CellSize,
    #[command(flatten)]
    columns: Columns,
    /// Address to listen on; any but loopback requires a token. By default 127.0.0.1, with --headset 0.0.0.0
    #[arg(long)]
    address: Option<IpAddr>,
    /// Port to listen on
    #[arg(long, default_value_t = 8765)]
    port: u16,
    /// Serve a headset or phone on the same network: HTTPS, which WebXR requires, with a self-made certificate, and a QR code of the
    /// address with its token. Headsets may publish (`allow_headset` of viewer_server)
    #[arg(long)]
    headset: bool,
    /// Certificate of one's own for --headset, with its chain (PEM)
    #[arg(long, value_name = "PEM", requires_all = ["headset", "tls_key"])]
    tls_certificate: Option<PathBuf>,
    /// Private key of that certificate (PEM)
    #[arg(long, value_name = "PEM", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// As for any ROS node: `--ros-args -r from:=to -p name:=value ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
}

impl View {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        match self.what.as_slice() {
            [one] if kind(one) != Kind::Params => {
                let options = self.options();
                show(one, &self.cells, self.columns, &options)
            }
            files => {
                if let Some(other) = files.iter().find(|file| kind(file) != Kind::Params) {
                    let other = other.display();
                    return Err(format!(
                        "{other}: give one map, one point file, one log, or {PARAMS}"
                    )
                    .into());
                }
                self.columns.options(MAX_POINTS, &[])?;
                self.cells
                    .expect_none("cells of nodes are set by `cell_size_m` of lattice_mapper")?;
                self.live()
            }
        }
    }

    fn ip(&self) -> IpAddr {
        let default = match self.headset {
            true => Ipv4Addr::UNSPECIFIED,
            false => Ipv4Addr::LOCALHOST,
        };
        self.address.unwrap_or(default.into())
    }

    /// Options of the server of a file.
    fn options(&self) -> ViewerOptions {
        let tls = match (&self.tls_certificate, &self.tls_key) {
            (Some(certificate), Some(key)) => Tls::Files {
                certificate: certificate.clone(),
                key: key.clone(),
            },
            _ if self.headset => Tls::SelfMade,
            _ => Tls::Off,
        };
        ViewerOptions {
            tls,
            ..plain(SocketAddr::new(self.ip(), self.port))
        }
    }

    fn live(self) -> CliResult {
        let mut values = vec![
            ("address", quoted(&self.ip().to_string())),
            ("port", self.port.to_string()),
        ];
        if self.headset {
            values.extend(["tls", "allow_headset"].map(|name| (name, true.to_string())));
        }
        let files = [
            ("tls_certificate", &self.tls_certificate),
            ("tls_key", &self.tls_key),
        ];
        for (name, path) in files {
            let Some(path) = path else { continue };
            let text = path.to_str();
            let text = text.ok_or_else(|| format!("{}: not UTF-8", path.display()))?;
            values.push((name, quoted(text)));
        }
        let mut ros_args = self.ros_args;
        if ros_args.is_empty() {
            ros_args.push("--ros-args".to_owned());
        }
        for (name, value) in values {
            ros_args.extend(["-p".to_owned(), format!("viewer_server:{name}:={value}")]);
        }
        Run::nodes_of(self.what, &["viewer_server"], ros_args).run()
    }
}

/// Options of a server without TLS.
fn plain(address: SocketAddr) -> ViewerOptions {
    ViewerOptions {
        address,
        ..ViewerOptions::default()
    }
}

/// Text as a YAML scalar.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}

/// Kind of input.
#[derive(PartialEq)]
enum Kind {
    Map,
    Points,
    Log,
    Params,
}

/// Limit of points per file.
const MAX_POINTS: usize = 500_000_000;

const PARAMS: &str = "parameter files (.yaml, .yml)";

/// Input kind by name; anything else is assumed to be a map.
fn kind(path: &Path) -> Kind {
    let ending = path.extension().and_then(|ending| ending.to_str());
    match ending.map(str::to_ascii_lowercase).as_deref() {
        _ if path.is_dir() || path.ends_with("metadata.yaml") => Kind::Log,
        Some("mcap" | "db3" | "bag" | "active" | "zstd" | "zst") => Kind::Log,
        Some("yaml" | "yml") => Kind::Params,
        _ if is_named_as_points(path) && !is_map(path) => Kind::Points,
        _ => Kind::Map,
    }
}

/// True for a map file with any name.
fn is_map(path: &Path) -> bool {
    std::fs::File::open(path).is_ok_and(lattice_core::voxels::file::is_map)
}

/// Shows a map file, or the map of a log or of points, until the process is ended.
fn show(path: &Path, cells: &CellSize, columns: Columns, server: &ViewerOptions) -> CliResult {
    crate::init_logging();
    let options = columns.options(MAX_POINTS, &[path])?;
    if kind(path) == Kind::Points {
        let list = quantized(path, cells, &options)?;
        let (_server, access) =
            viewer_server::serve_labelled(&list, &LabelNames::default(), server)?;
        return stay(&access);
    }
    #[cfg(feature = "bags")]
    let folder = tempfile::tempdir()?;
    #[cfg(feature = "bags")]
    let mapped = folder.path().join("map.lattice");
    #[cfg(feature = "bags")]
    let path = match kind(path) {
        Kind::Log => {
            let mut replay = crate::replay::Replay::of_log(path, &mapped);
            replay.cells = *cells;
            replay.replay()?.check()?;
            &mapped
        }
        _ => {
            cells.expect_none("the cells of a map file are fixed")?;
            path
        }
    };
    let (_server, access) = serve(path, server)?;
    // The map is in memory, so its folder is removed now; the process ends by a signal.
    #[cfg(feature = "bags")]
    drop(folder);
    stay(&access)
}

/// Map of a point file on the FCC lattice; prints its cell size.
fn quantized(path: &Path, cells: &CellSize, options: &PointFileOptions) -> CliResult<VoxelList> {
    let points = Points::read(path, options)?;
    let (volume_m3, why) = match cells.volume_m3() {
        Some(volume_m3) => (volume_m3, String::new()),
        None => {
            let (size_m, why) = points.usual_cell_m();
            let why = format!(", {why} (--cell-size sets it)");
            (cube_m3(size_m), why)
        }
    };
    let lattice = Lattice::new(LatticeKind::Fcc, volume_m3)?;
    let size_m = lattice.cell_side_m();
    let (list, report) = points.quantize(lattice, usize::MAX, true)?;
    let (path, voxels) = (path.display(), list.len());
    println!(
        "{path}: {} points, {voxels} voxels of the FCC lattice, cell size {size_m:.4} m{why}",
        report.inserted
    );
    let refused = points.not_finite + report.not_finite + report.out_of_range;
    if refused > 0 {
        println!("{refused} points are not finite or out of range, and are skipped");
    }
    Ok(list)
}

/// Serves until the process is ended.
fn stay(access: &Access) -> CliResult {
    println!("the map is at {}, until Ctrl-C", access.url);
    if let Some(text) = access.for_headset(std::io::stdout().is_terminal()) {
        print!("{text}");
    }
    loop {
        std::thread::park();
    }
}

/// Serves a map file on loopback; returns the server and its URL.
#[cfg(feature = "lab")]
pub fn serve_file(path: &Path, address: SocketAddr) -> CliResult<(viewer_server::Server, String)> {
    let (server, access) = serve(path, &plain(address))?;
    Ok((server, access.url))
}

fn serve(path: &Path, options: &ViewerOptions) -> CliResult<(viewer_server::Server, Access)> {
    let (map, names) = crate::map::read_named(path).map_err(|error| {
        let points =
            "a point file (.ply, .pcd, .las, .laz, .e57, .bt, .ot, .xyz, .txt, .csv, .bin)";
        let logs = "a log (a rosbag2 folder, .mcap, .db3, .bag, each also as .zstd)";
        format!("{error}; what is shown is a map (.lattice), {points}, {logs}, or {PARAMS}")
    })?;
    let list = map.into_list(usize::MAX);
    Ok(viewer_server::serve_labelled(&list, &names, options)?)
}
