//! Ryde & Brünig 2011, "Lattice Occupied Voxel Lists for Representation of Spatial Occupancy", computed
//! anew.

mod cells;
mod distances;
mod generators;
mod loader;
mod matching;
mod neighbors;
mod quantization;
mod radial;
mod report_options;
mod rotations;
mod sample;
mod scan;
mod theory;

use crate::report::{Report, Section};
use crate::{AnyError, at};
pub use report_options::Options;
use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

type Make = fn(&Options, &mut dyn FnMut(f64)) -> Result<Section, AnyError>;

/// Name, share of the time, and what makes it; in the order of the paper.
const SECTIONS: [(&str, f64, Make); 10] = [
    ("cells", 0.1, cells::section),
    ("eq. (1)-(2)", 3.0, quantization::section),
    ("eq. (3)-(7)", 0.1, neighbors::section),
    ("eq. (8)-(12)", 0.1, generators::section),
    ("eq. (13)", 3.0, theory::section),
    ("Fig. 3", 0.1, distances::section),
    ("Fig. 4", 6.0, radial::section),
    ("Fig. 5", 60.0, rotations::section),
    ("Table I", 10.0, loader::section),
    ("Fig. 6", 150.0, matching::section),
];

/// Computes all sections; `progress` gets the share done and the name of the next section.
pub fn run(options: &Options, progress: &mut dyn FnMut(f64, &str)) -> Result<Report, AnyError> {
    // Before a minute of work.
    let files = options.scans.iter().chain(&options.bags);
    let files = files.chain(options.pair_files.iter().flatten());
    for path in files.chain(&options.pairs) {
        fs::metadata(path).map_err(at(path))?;
    }
    let all: f64 = SECTIONS.iter().map(|(_, share, _)| share).sum();
    let mut before = 0.0;
    let mut sections = Vec::new();
    for (name, share, make) in SECTIONS {
        progress(before / all, name);
        let mut tell = |done: f64| progress((before + share * done) / all, name);
        sections.push(make(options, &mut tell)?);
        before += share;
    }
    let title = "Ryde and Brünig 2011, Lattice Occupied Voxel Lists for Representation of Spatial Occupancy";
    let command = command(options);
    Ok(Report::of_paper(title, command, options.quick, sections))
}

/// The command line, with the names of files but not where they lie.
fn command(options: &Options) -> String {
    let mut words = format!("lattice paper voxels --seed {}", options.seed);
    if options.quick {
        words.push_str(" --quick");
    }
    let named = |option: &str, path: &PathBuf| format!(" --{option} {}", file_name(path));
    words.extend(options.scans.iter().map(|path| named("scan", path)));
    words.extend(options.bags.iter().map(|path| named("bag", path)));
    words.extend(options.pairs.iter().map(|path| named("pairs", path)));
    for [map, scan, pose] in &options.pair_files {
        words.push_str(&named("pair", map));
        words.extend([scan, pose].map(|path| format!(" {}", file_name(path))));
    }
    words
}

fn file_name(path: &Path) -> Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_do_not_depend_on_threads() {
        let options = Options {
            seed: 1,
            quick: true,
            scans: Vec::new(),
            bags: Vec::new(),
            pairs: None,
            pair_files: Vec::new(),
        };
        // Figs. 5 and 6 take most of the time; their loops have tests of their own.
        let quick = |(name, ..): &&(&str, f64, Make)| !["Fig. 5", "Fig. 6"].contains(name);
        let make = |(_, _, make): &(&str, f64, Make)| make(&options, &mut |_| {}).unwrap();
        // With the pictures, which JSON leaves out.
        let all = || SECTIONS.iter().filter(quick).map(make).collect::<Vec<_>>();
        let on = |threads: usize| format!("{:?}", crate::pool(threads).unwrap().install(all));
        assert!(on(1) == on(3));
    }
}
