//! Trials of scan matching: one scan as a map, one to align, a random lattice pose and a random start.

use super::scenes::{MAX_BYTES, Scene, Source};
use crate::AnyError;
use crate::matching::{MultiResolutionList, align};
use crate::paper::parallel::in_parallel;
use crate::paper::streams::{Purpose, stream};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Levels of a list: cells of one, two and four sides.
const LEVELS: usize = 3;
/// A start is turned by up to this for each metre that it may be off, about each axis, degrees.
const TURN_DEG_PER_M: f64 = 10.0;
/// The lattice is moved by up to this along each axis, metres.
const OFFSET_M: f64 = 10.0;
/// Numbers of streams apart for each scene.
const SCENE: usize = 1 << 32;

/// Outcome of an alignment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Outcome {
    /// Distance from the true position of the scanner, metres.
    pub(super) error_m: f64,
    /// Poses tried.
    pub(super) evaluations: usize,
}

/// Outcomes in a scene, by trial for each lattice of [`LatticeKind::ALL`].
pub(super) struct Trials {
    pub(super) by_lattice: [Vec<Outcome>; 6],
}

impl Trials {
    /// Errors of a lattice, metres, in the order of the trials.
    pub(super) fn errors_m(&self, lattice: usize) -> Vec<f64> {
        let outcomes = self.by_lattice.get(lattice).into_iter().flatten();
        outcomes.map(|outcome| outcome.error_m).collect()
    }

    /// Poses tried, on average.
    pub(super) fn evaluations(&self, lattice: usize) -> f64 {
        let outcomes = self.by_lattice.get(lattice).map_or(&[][..], Vec::as_slice);
        let sum: usize = outcomes.iter().map(|o| o.evaluations).sum();
        sum as f64 / outcomes.len() as f64
    }
}

/// Runs `n` trials; all lattices get the same scans, the same start, and lie in the same way.
pub(super) fn run(
    scene: &Scene,
    number: usize,
    source: &Source,
    seed: u64,
    n: usize,
    progress: &mut dyn FnMut(f64),
) -> Result<Trials, AnyError> {
    let trial = |i: usize| trial(scene, source, seed, (number, i));
    let mut trials = Trials {
        by_lattice: [(); 6].map(|()| Vec::with_capacity(n)),
    };
    for outcomes in in_parallel(n, progress, trial) {
        for (all, outcome) in trials.by_lattice.iter_mut().zip(outcomes?) {
            all.push(outcome);
        }
    }
    Ok(trials)
}

fn trial(
    scene: &Scene,
    source: &Source,
    seed: u64,
    (number, i): (usize, usize),
) -> Result<[Outcome; 6], AnyError> {
    let pair = source.pair(seed, number, i).ok_or("there are no scans")?;
    let mut stream = stream(seed, Purpose::Matching, number * SCENE + i);
    let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), TAU * stream.uniform());
    let offset_m = OFFSET_M * stream.point();
    let mut about_zero = |most: f64| (2.0 * stream.point()).map(|x| most * (x - 1.0));
    let shift_m = about_zero(scene.start_m);
    let turn_rad = about_zero((TURN_DEG_PER_M * scene.start_m).to_radians());
    // The lattice stays about 0 and the map moves.
    let truth = Translation3::from(offset_m) * pair.map_from_scan;
    let start = Isometry3::from_parts(
        Translation3::from(truth.translation.vector + shift_m),
        UnitQuaternion::from_scaled_axis(turn_rad) * truth.rotation,
    );
    let cloud = |datum_m, offsets_m| Cloud {
        stamp_ns: 0,
        datum_m,
        offsets_m,
    };
    let map = cloud(offset_m, pair.map);
    let scan = cloud(Vector3::zeros(), pair.scan);
    let unknown = Outcome {
        error_m: f64::NAN,
        evaluations: 0,
    };
    let mut outcomes = [unknown; 6];
    for (kind, outcome) in LatticeKind::ALL.into_iter().zip(&mut outcomes) {
        let lattice = Lattice::new(kind, scene.side_m.powi(3))?.oriented(yaw);
        let mut list = MultiResolutionList::new(&lattice, offset_m, LEVELS, MAX_BYTES)?;
        list.insert(&map);
        let found = align(&list, &scan, &start)?;
        let off = found.map_from_cloud.translation.vector - truth.translation.vector;
        *outcome = Outcome {
            error_m: off.norm(),
            evaluations: found.evaluations,
        };
    }
    Ok(outcomes)
}

#[cfg(test)]
mod tests {
    use super::super::scenes::scenes;
    use super::*;

    #[test]
    fn trials_come_closer_and_do_not_depend_on_threads() {
        let (sources, scenes) = scenes(2, None, &[]).unwrap();
        let scene = &scenes[1];
        let on = |threads: usize| {
            let go = || run(scene, 1, &sources[0], 2, 6, &mut |_| {}).unwrap();
            crate::pool(threads).unwrap().install(go)
        };
        let (one, two) = (on(1), on(2));
        for (lattice, kind) in LatticeKind::ALL.into_iter().enumerate() {
            assert_eq!(one.by_lattice[lattice], two.by_lattice[lattice]);
            let errors = one.errors_m(lattice);
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            assert!(errors.len() == 6 && mean < 0.15, "{kind}: {errors:?}");
            assert!(one.evaluations(lattice) > 4.0 * 13.0);
        }
    }
}
