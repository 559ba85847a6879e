//! Calibrations that must not be called certain: rooms that look alike from several places, and clouds in
//! wrong axes, of a wrong scale, leaning, or of another building.

mod report;
mod scenes;

pub use report::traps_report;

use lattice_core::registration::{CalibrationMap, CalibrationRequest, calibrate};
use nalgebra::Isometry3;

use super::many::run_many;
use super::settings::{Cell, Settings};
use super::trial::{OURS, Trial};
use super::{Results, Start};
use crate::AnyError;
use crate::random::Stream;
use scenes::{Fault, SHAPES, of_fault, of_shape};

/// Side of the cells of the maps, metres.
const CELL_SIDE_M: f64 = 0.05;

/// A trap: what is asked, apart from its seed.
#[derive(Clone, Copy, Debug)]
enum Trap {
    /// Number of the shape, and if it is seen whole, with a box, with labels.
    Alike {
        shape: usize,
        whole: bool,
        boxed: bool,
        labelled: bool,
    },
    Fault(Fault),
}

impl Trap {
    fn all() -> Vec<Trap> {
        let mut all: Vec<Trap> = Fault::all().into_iter().map(Trap::Fault).collect();
        for shape in 0..SHAPES.len() {
            for labelled in [false, true] {
                for (whole, boxed) in [(true, false), (false, false), (true, true)] {
                    all.push(Trap::Alike {
                        shape,
                        whole,
                        boxed,
                        labelled,
                    });
                }
            }
        }
        all
    }

    /// Name of the scene, by which the report sorts.
    fn name(self) -> String {
        match self {
            Trap::Fault(fault) => format!("{WRONG_INPUT}/{}", fault.name()),
            Trap::Alike {
                shape,
                whole,
                boxed,
                labelled,
            } => {
                let kind = if boxed { BROKEN } else { ALIKE };
                let shape = SHAPES.get(shape).map_or("", |shape| shape.0);
                let view = if whole { "whole" } else { "in part" };
                let labels = if labelled { "labels" } else { "no labels" };
                format!("{kind}/{shape}, {view}, {labels}")
            }
        }
    }

    fn run(self, seed: u64) -> Result<Trial, AnyError> {
        let cell = cell(self, seed);
        let number = u64::from(crc32fast::hash(cell.scene.as_bytes()));
        let random = &mut Stream::numbered(seed, number);
        let scene = match self {
            Trap::Fault(fault) => of_fault(fault, seed, random),
            Trap::Alike {
                shape,
                whole,
                boxed,
                labelled,
            } => {
                let shape = *SHAPES.get(shape).ok_or("no such shape")?;
                of_shape(shape, whole, boxed, labelled, random)
            }
        };
        let map = CalibrationMap::new(scene.map, CELL_SIDE_M)?;
        let seen_m = scene.scan.cloud.points_m.clone();
        let request = CalibrationRequest {
            headset_scans: &[scene.scan],
            start: None,
            confusion: None,
        };
        let found = calibrate(&map, &request, &scene.options, &());
        let pose: &Isometry3<f64> = &found.map_from_headset;
        // Times are taken beside other trials: they would say nothing.
        let trial = Trial::of_pose(&cell, OURS, pose, &scene.truth, &seen_m, 0.0);
        Ok(trial.with_judgement(&found, &scene.truth))
    }
}

/// Kinds of traps, the first part of a scene's name.
const ALIKE: &str = "alike";
const BROKEN: &str = "broken";
const WRONG_INPUT: &str = "wrong input";

fn cell(trap: Trap, seed: u64) -> Cell {
    Cell {
        scene: trap.name(),
        seed,
        q: 0.0,
        start: Start::None.to_string(),
    }
}

/// Settings that results of traps are kept with.
pub fn settings() -> Settings {
    Settings {
        cell_side_m: CELL_SIDE_M,
        survey_views: 0,
        map_seeds: 0,
        ..Settings::default()
    }
}

/// Runs the trials of `seeds` seeds that the results do not have yet, on `threads` threads.
///
/// `progress` hears of trials done, of all.
pub fn run(
    seeds: u64,
    results: &mut Results,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(), AnyError> {
    let traps = Trap::all();
    // Seed by seed, so that what is done first covers all traps.
    let all = (0..seeds).flat_map(|seed| traps.iter().map(move |trap| (cell(*trap, seed), *trap)));
    let run = |cell: &Cell, trap: &Trap| trap.run(cell.seed);
    run_many(all.collect(), run, results, threads, progress)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trap_is_the_same_each_time_and_its_reason_is_told() {
        let trap = Trap::Fault(Fault::Scale(1.25));
        let trial = trap.run(0).unwrap();
        assert_eq!(trial, trap.run(0).unwrap());
        assert!(!trial.is_accepted());
        let mut names: Vec<String> = Trap::all().into_iter().map(Trap::name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), Trap::all().len());
    }
}
