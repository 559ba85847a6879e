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

use crate::paper::command::command;
use crate::paper::sections::{Part, in_order};
use crate::report::{Report, Section};
use crate::{AnyError, at};
pub use report_options::Options;
use std::{fs, slice};

type Make = fn(&Options, &mut dyn FnMut(f64)) -> Result<Section, AnyError>;

/// Sections in the order of the paper.
const SECTIONS: [Part<Make>; 10] = [
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
    let make = |make: Make, tell: &mut dyn FnMut(f64)| Ok(vec![make(options, tell)?]);
    let sections = in_order(&SECTIONS, progress, make)?;
    let title = "Ryde and Brünig 2011, Lattice Occupied Voxel Lists for Representation of Spatial Occupancy";
    let one = |option: &'static str| move |path| (option, slice::from_ref(path));
    let files = options.scans.iter().map(one("scan"));
    let files = files.chain(options.bags.iter().map(one("bag")));
    let files = files.chain(options.pairs.iter().map(one("pairs")));
    let pairs = options.pair_files.iter();
    let files = files.chain(pairs.map(|files| ("pair", files.as_slice())));
    let command = command("voxels", (options.seed, options.quick), files);
    Ok(Report::of_paper(title, command, options.quick, sections))
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
