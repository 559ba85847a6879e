//! `lattice view`: a map in the browser.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

use clap::Args;
use lattice_nodes::viewer_server::{self, ViewerOptions};

use super::CliResult;
use crate::run::Run;

/// Show a map in the browser: of a file, of a log, or live
#[derive(Args)]
pub struct View {
    /// A map file; a rosbag2 log, which is mapped first; parameter files, whose nodes are run with the
    /// viewer. Nothing: the map of the nodes that run on this ROS domain
    what: Vec<PathBuf>,
    /// Address to listen on; any but this machine's own makes a token
    #[arg(long, default_value = "127.0.0.1")]
    address: IpAddr,
    /// Port to listen on
    #[arg(long, default_value_t = 8765)]
    port: u16,
    /// As for any ROS node: `--ros-args -r from:=to -p name:=value ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
}

impl View {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        match self.what.as_slice() {
            [one] if kind(one) != Kind::Params => {
                show(one, SocketAddr::new(self.address, self.port))
            }
            files => {
                if let Some(other) = files.iter().find(|file| kind(file) != Kind::Params) {
                    let other = other.display();
                    return Err(format!("{other}: give one map, one log, or {PARAMS}").into());
                }
                self.live()
            }
        }
    }

    fn live(self) -> CliResult {
        let mut ros_args = self.ros_args;
        if ros_args.is_empty() {
            ros_args.push("--ros-args".to_owned());
        }
        for (name, value) in [
            ("address", format!("'{}'", self.address)),
            ("port", self.port.to_string()),
        ] {
            ros_args.extend(["-p".to_owned(), format!("viewer_server:{name}:={value}")]);
        }
        Run::nodes_of(self.what, &["viewer_server"], ros_args).run()
    }
}

/// Kind of what is shown.
#[derive(PartialEq)]
enum Kind {
    Map,
    Log,
    Params,
}

const PARAMS: &str = "parameter files (.yaml, .yml)";

/// The kind that a name tells; what else it is, is taken for a map.
fn kind(path: &Path) -> Kind {
    let ending = path.extension().and_then(|ending| ending.to_str());
    match ending.map(str::to_ascii_lowercase).as_deref() {
        _ if path.is_dir() || path.ends_with("metadata.yaml") => Kind::Log,
        Some("mcap" | "db3" | "zstd" | "zst") => Kind::Log,
        Some("yaml" | "yml") => Kind::Params,
        _ => Kind::Map,
    }
}

/// Shows a map file, or the map of a log, until the process is ended.
fn show(path: &Path, address: SocketAddr) -> CliResult {
    #[cfg(feature = "bags")]
    let folder = tempfile::tempdir()?;
    #[cfg(feature = "bags")]
    let mapped = folder.path().join("map.lattice");
    #[cfg(feature = "bags")]
    let path = match kind(path) {
        Kind::Log => {
            crate::replay::Replay::of_log(path, &mapped).replay()?;
            &mapped
        }
        _ => path,
    };
    let (_server, url) = serve_file(path, address)?;
    // The map is in memory; only a signal ends this process.
    #[cfg(feature = "bags")]
    drop(folder);
    println!("the map is at {url}, until Ctrl-C");
    loop {
        std::thread::park();
    }
}

/// Serves a map file; gives the server and the address to open.
pub fn serve_file(path: &Path, address: SocketAddr) -> CliResult<(viewer_server::Server, String)> {
    let (map, names) = crate::map::read_named(path).map_err(|error| {
        let logs = "a log (a rosbag2 folder, .mcap, .db3, each also as .zstd)";
        format!("{error}; what is shown is a map (.lattice), {logs}, or {PARAMS}")
    })?;
    let options = ViewerOptions {
        address,
        ..ViewerOptions::default()
    };
    let list = map.into_list(usize::MAX);
    Ok(viewer_server::serve_labelled(&list, &names, &options)?)
}
