//! The whole chain from images to a verdict, with a network in it: a robot's survey and a headset's look are rendered,
//! labelled by the network, made points by the machines of `semantic_cloud` and `headset_cloud`, and calibrated
//! without a start; beside it the same without labels, with true labels, and by GICP-SE(3) from starts near the
//! truth.

mod devices;
mod methods;
mod report;

pub use report::chain_report;

use std::collections::{BTreeSet, HashSet};
use std::path::PathBuf;
use std::sync::{Mutex, OnceLock};

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::registration::{
    CalibrationMap, CalibrationOptions, PrepareOptions, PreparedCloud, SemanticCloud, SourceCloud,
    voxel_downsample,
};
use lattice_nodes::segmenter::{Segmenter, SegmenterOptions, read_network};
use nalgebra::{Isometry3, Point3};

use super::global_registration::register;
use super::initial_guess::perturbed;
use super::methods::Baseline;
use super::results::name;
use super::runner::{Found, run_jobs};
use super::settings::{Cell, Settings, Start, check_seeds};
use super::trial::{LabelsRight, OURS, Trial, rounded};
use super::{Results, read_house};
use crate::options::within;
use crate::random::seed_of;
use crate::simulate::house::{HeadsetTrial, House, RoomCamera, RoomImages, Scene};
use crate::{AnyError, at, pool};
use devices::{
    Both, headset_mesh, headset_scan, house_from_headset, middle_m, right_share, robot_map,
    together, unlabelled,
};
use methods::{COMPETITOR, STARTS, TRUE_LABELS, UNLABELLED};

/// Purposes of seeds.
const VIEW: u64 = 11;
const SURVEY: u64 = 12;
const LOOK: u64 = 13;
const IMAGE: u64 = 14;
const START: u64 = 15;

/// Distance within which a point of the headset is compared with one of the map, metres.
const SHARED_M: f64 = 0.15;

/// Options of the evaluation.
#[derive(Clone, Debug)]
pub struct ChainOptions {
    /// Trials of each scene.
    pub seeds: u64,
    /// Surveys of the robot, each of other materials and lamps, and without a mesh of other clutter.
    pub maps: u64,
    /// Views of a survey.
    pub views: usize,
    /// Pictures that the headset takes at a scene, turned to its sides after the first.
    pub looks: usize,
    /// A mesh and the names of its classes, which are those of the network.
    pub mesh: Option<(PathBuf, PathBuf)>,
    /// The network.
    pub model: PathBuf,
    /// Trials at once.
    pub threads: usize,
}

impl ChainOptions {
    fn check(&self) -> Result<(), AnyError> {
        check_seeds(self.seeds)?;
        within("maps", self.maps as f64, 1.0, 1000.0)
    }
}

/// A house with a headset scan, and its map: with labels of the network, with true ones, and without.
struct Place {
    house: House,
    look: u64,
    map: Both<CalibrationMap>,
    unlabelled: CalibrationMap,
    labels_right: f64,
}

/// All that trials share.
struct Chain<'a> {
    options: &'a ChainOptions,
    segmenter: Mutex<Segmenter>,
    places: Vec<OnceLock<Result<Place, String>>>,
    cell_side_m: f64,
}

/// Settings that results of the chain are kept with.
///
/// # Errors
/// If an option is out of its range or a file cannot be read.
pub fn chain_settings(options: &ChainOptions) -> Result<Settings, AnyError> {
    options.check()?;
    let crc32 = |path: &PathBuf| -> Result<u32, AnyError> {
        Ok(crc32fast::hash(&std::fs::read(path).map_err(at(path))?))
    };
    let mesh = options.mesh.as_ref().map(|(mesh, _)| crc32(mesh));
    Ok(Settings {
        mesh_crc32: mesh.transpose()?,
        model_crc32: Some(crc32(&options.model)?),
        survey_views: options.views,
        map_seeds: options.maps,
        headset_scans: options.looks,
        ..Settings::default()
    })
}

/// Runs the trials that the results do not have yet, seed by seed.
///
/// `progress` is called with the number of views done, and of all that are left.
pub fn run_chain(
    options: &ChainOptions,
    results: &mut Results,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(), AnyError> {
    let chain = Chain::new(options)?;
    let done = results.done();
    let all = (0..options.seeds).flat_map(|seed| Scene::ALL.map(|scene| (seed, scene)));
    let left: Vec<(u64, Scene)> = all
        .filter(|&(seed, scene)| !is_done(&done, seed, scene))
        .collect();
    let pool = pool(options.threads)?;
    // Before the trials: a thread of the pool that waited in one for a survey could have begun that survey itself.
    let numbers: BTreeSet<u64> = left.iter().map(|(seed, _)| seed % options.maps).collect();
    pool.install(|| numbers.iter().try_for_each(|&n| chain.place(n).map(|_| ())))?;
    let work = |&(seed, scene): &(u64, Scene), found: &mut Found<Vec<Trial>>| {
        found(chain.trials(seed, scene)?)
    };
    let mut count = 0;
    let mut keep = |trials: Vec<Trial>| {
        let new = |trial: &Trial| !done.contains(&name(&trial.cell, &trial.method));
        let mut new = trials.into_iter().filter(new);
        new.try_for_each(|trial| results.add(trial))?;
        count += 1;
        progress(count, left.len());
        Ok(())
    };
    run_jobs(&left, options.threads.max(1), &[pool], work, &mut keep)
}

fn cell(seed: u64, scene: Scene, start: Start) -> Cell {
    Cell {
        scene: scene.name().to_owned(),
        seed,
        q: 0.0,
        start: start.to_string(),
    }
}

fn is_done(done: &HashSet<String>, seed: u64, scene: Scene) -> bool {
    let ours = [OURS, UNLABELLED, TRUE_LABELS].map(|method| (method, Start::None));
    let others = STARTS.map(|start| (COMPETITOR, start));
    let mut all = ours.into_iter().chain(others);
    all.all(|(method, start)| done.contains(&name(&cell(seed, scene, start), method)))
}

impl Chain<'_> {
    fn new(options: &ChainOptions) -> Result<Chain<'_>, AnyError> {
        options.check()?;
        let network = read_network(&options.model, None, 1)?;
        Ok(Chain {
            segmenter: Mutex::new(Segmenter::new(SegmenterOptions::default(), network)),
            places: (0..options.maps).map(|_| OnceLock::new()).collect(),
            cell_side_m: Settings::default().cell_side_m,
            options,
        })
    }

    /// The place of a seed, surveyed when it is first needed.
    fn place(&self, seed: u64) -> Result<&Place, AnyError> {
        let number = seed % self.options.maps;
        let slot = self
            .places
            .get(number as usize)
            .ok_or("no place of that number")?;
        let made = slot.get_or_init(|| self.survey(number).map_err(|error| error.to_string()));
        made.as_ref().map_err(|error| error.clone().into())
    }

    fn survey(&self, number: u64) -> Result<Place, AnyError> {
        let (house, _) = read_house(self.options.mesh.as_ref(), seed_of(&[LOOK, number]))?;
        let look = seed_of(&[LOOK, number, 1]);
        let lattice = Lattice::new(LatticeKind::Cubic, self.cell_side_m.powi(3))?;
        let rooms = RoomImages::new(&house, look);
        let seed = seed_of(&[SURVEY, number]);
        let map = robot_map(&rooms, &self.segmenter, &lattice, self.options.views, seed)?;
        let prepared = |cloud: SemanticCloud| CalibrationMap::new(cloud, self.cell_side_m);
        Ok(Place {
            labels_right: right_share(&map.found, &map.truth)?,
            unlabelled: prepared(unlabelled(&map.found))?,
            map: Both {
                found: prepared(map.found)?,
                truth: prepared(map.truth)?,
            },
            house,
            look,
        })
    }

    /// All trials of what the headset sees of a scene.
    fn trials(&self, seed: u64, scene: Scene) -> Result<Vec<Trial>, AnyError> {
        let place = self.place(seed)?;
        let looks = self.options.looks;
        let trial = HeadsetTrial::new(&place.house, scene, looks, seed_of(&[VIEW, seed]))?;
        let rooms = RoomImages::new(&place.house, place.look);
        let chunks = headset_mesh(&rooms, &trial);
        let scans = (0_u64..).zip(&trial.headset_scans).map(|(number, seen)| {
            let image_seed = seed_of(&[IMAGE, seed, scene as u64, number]);
            let pose = house_from_headset(&rooms, &trial) * seen.headset_from_camera;
            let image = rooms.take(&RoomCamera::HEADSET, &pose, image_seed);
            headset_scan(&image, &self.segmenter, &chunks, seen)
        });
        let scans: Vec<Option<Both<SourceCloud>>> = scans.collect::<Result<_, _>>()?;
        let scans = scans.into_iter().flatten();
        let (found, right): (Vec<_>, Vec<_>) = scans.map(|s| (s.found, s.truth)).unzip();
        let (seen, seen_right) = (together(&found), together(&right));
        let labels = LabelsRight {
            map: rounded(place.labels_right),
            headset: rounded(right_share(&seen, &seen_right)?),
        };
        let truth = trial.map_from_headset;
        let bare = found.iter().map(|scan| SourceCloud {
            cloud: unlabelled(&scan.cloud),
            sensor_m: scan.sensor_m,
        });
        let bare: Vec<_> = bare.collect();
        let mut trials = Vec::new();
        let none = cell(seed, scene, Start::None);
        let seen_bare = unlabelled(&seen);
        for (method, map, headset_scans, cloud) in [
            (OURS, &place.map.found, &found, &seen),
            (UNLABELLED, &place.unlabelled, &bare, &seen_bare),
            (TRUE_LABELS, &place.map.truth, &right, &seen_right),
        ] {
            let found = register(map, headset_scans, None, &CalibrationOptions::default());
            trials.push(Trial {
                labels: (method == OURS).then_some(labels),
                different_share: rounded(different_share(map, cloud, &truth)),
                ..Trial::of_calibration(&none, method, &found, &truth, &cloud.points_m)
            });
        }
        let source = voxel_downsample(&seen, self.cell_side_m);
        let source = PreparedCloud::new(source, &PrepareOptions::default())?;
        let pivot_m = middle_m(&seen);
        for start in STARTS {
            let cell = cell(seed, scene, start);
            let seed = [START, seed, scene as u64];
            let from = start_pose(start, &truth, &pivot_m, &seed);
            let found = Baseline::named(COMPETITOR).map_or(from, |method| {
                method.register(&source, &place.map.found, &from)
            });
            let seen_m = source.points_m();
            trials.push(Trial::of_pose(
                &cell, COMPETITOR, &found, &truth, seen_m, 0.0,
            ));
        }
        Ok(trials)
    }
}

/// The truth, moved and turned as a start says.
fn start_pose(
    start: Start,
    truth: &Isometry3<f64>,
    pivot_m: &Point3<f64>,
    seed: &[u64; 3],
) -> Isometry3<f64> {
    match start {
        Start::Off { m, deg } => {
            let seed = seed_of(&[seed.as_slice(), &[m.to_bits()]].concat());
            perturbed(truth, pivot_m, m, deg, seed)
        }
        Start::None => Isometry3::identity(),
    }
}

/// Share of points with another label than the map has beside them, of those that both have.
fn different_share(map: &CalibrationMap, scan: &SemanticCloud, truth: &Isometry3<f64>) -> f64 {
    let (mut different, mut all) = (0_u64, 0_u64);
    for (point_m, label) in scan.points_m.iter().zip(&scan.labels) {
        let near = map.cloud().nearest(&(truth * point_m), SHARED_M);
        let beside = near.and_then(|(index, _)| map.cloud().label(index).top());
        if let (Some(label), Some(beside)) = (label.top(), beside) {
            all += 1;
            different += u64::from(label != beside);
        }
    }
    different as f64 / all.max(1) as f64
}

#[cfg(all(test, feature = "onnx"))]
mod tests {
    use super::*;

    #[test]
    fn a_look_through_the_chain_has_labels_that_are_wrong_and_is_the_same_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let options = ChainOptions {
            seeds: 1,
            maps: 1,
            views: 24,
            looks: 2,
            mesh: None,
            model: crate::models::write_rooms(folder.path()).unwrap(),
            threads: 1,
        };
        let trials = || Chain::new(&options).unwrap().trials(0, Scene::Tv).unwrap();
        let found = trials();
        assert_eq!(found.len(), 5);
        assert_eq!(found, trials());
        let of = |method: &str| found.iter().find(|t| t.method == method).unwrap();
        let labels = of(OURS).labels.unwrap();
        assert!(labels.map > 0.4 && labels.headset > 0.3, "{labels:?}");
        assert!(of(OURS).different_share > of(TRUE_LABELS).different_share);
        assert!(of(TRUE_LABELS).different_share < 0.2);
        assert!(
            [OURS, UNLABELLED, TRUE_LABELS]
                .iter()
                .all(|m| of(m).judged.is_some())
        );
        let report = crate::report::markdown(&chain_report(&found));
        assert!(report.contains("labels of the network | 1 |"), "{report}");
        assert!(chain_settings(&options).unwrap().model_crc32.is_some());
    }
}
