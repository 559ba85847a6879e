//! Adversarial scenes, which must not yield a confident wrong pose: rooms that look alike from several places, and
//! clouds with wrong axes, a wrong scale, a tilt, or of another building.

mod report;
mod scenes;

pub use report::adversarial_report;

use lattice_core::registration::CalibrationMap;

use super::global_registration::register;
use super::many::Case;
use super::settings::Cell;
use super::trial::{OURS, Trial};
use crate::AnyError;
use crate::random::Stream;
use scenes::{ALIKE, BROKEN, Fault, Look, NEARLY, Object, Scene, WRONG_INPUT, small_room};

/// Adversarial scene.
#[derive(Clone, Copy, Debug)]
pub struct AdversarialScene(Kind);

#[derive(Clone, Copy, Debug)]
enum Kind {
    Alike(Look),
    SmallRoom(Object),
    Fault(Fault),
}

impl AdversarialScene {
    /// Cell size of the maps, metres.
    pub const CELL_SIDE_M: f64 = 0.05;

    /// All adversarial scenes.
    pub fn all() -> Vec<AdversarialScene> {
        let faults = Fault::all().into_iter().map(Kind::Fault);
        let all = faults.chain(Look::all().into_iter().map(Kind::Alike));
        all.chain([Object::None, Object::Cube].map(Kind::SmallRoom))
            .map(AdversarialScene)
            .collect()
    }
}

/// Kind of a room with an object in it.
fn kind_of(object: Object) -> &'static str {
    match object {
        Object::None => ALIKE,
        Object::Box => BROKEN,
        Object::Cube => NEARLY,
    }
}

impl Case for AdversarialScene {
    fn name(&self) -> String {
        match self.0 {
            Kind::Fault(fault) => format!("{WRONG_INPUT}/{}", fault.name()),
            Kind::Alike(look) => format!("{}/{}", kind_of(look.object), look.name()),
            Kind::SmallRoom(object) => {
                format!("{}/small room, whole, no labels", kind_of(object))
            }
        }
    }

    fn run(&self, cell: &Cell) -> Result<Trial, AnyError> {
        let number = u64::from(crc32fast::hash(cell.scene.as_bytes()));
        let random = &mut Stream::numbered(cell.seed, number);
        let Scene {
            map,
            scan,
            options,
            truth,
        } = match self.0 {
            Kind::Fault(fault) => fault.scene(cell.seed, random),
            Kind::Alike(look) => look.scene(random),
            Kind::SmallRoom(object) => small_room(object, random),
        };
        let map = CalibrationMap::new(map, Self::CELL_SIDE_M)?;
        let seen_m = scan.cloud.points_m.clone();
        let found = register(&map, &[scan], None, &options);
        Ok(Trial::of_calibration(cell, OURS, &found, &truth, &seen_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::pose::Axes;

    /// All of them were once OK, up to twelve metres off.
    #[test]
    fn faults_that_fit_elsewhere_too_are_named() {
        let faults = [
            (Fault::Scale(0.9), 0),
            (Fault::Scale(0.8), 1),
            (Fault::Scale(0.95), 2),
            (Fault::Scale(1.05), 2),
            (Fault::Axes(Axes::UnityRuf, Axes::WinrtRub), 3),
            (Fault::Axes(Axes::WinrtRub, Axes::UnityRuf), 3),
            // These fit all points elsewhere, through surfaces.
            (Fault::Axes(Axes::WinrtRub, Axes::UnityRuf), 18),
            (Fault::Mirrored, 18),
            (Fault::Scale(0.9), 19),
        ];
        for (fault, seed) in faults {
            let scene = AdversarialScene(Kind::Fault(fault));
            let trial = scene.run(&scene.cell(seed)).unwrap();
            let reason = &trial.judged.as_ref().unwrap().reason;
            assert!(!trial.is_accepted(), "{fault:?}: {reason}");
            assert!(fault.is_named_by(reason), "{fault:?}: {reason}");
        }
    }

    #[test]
    fn an_adversarial_scene_is_reproducible() {
        let scene = AdversarialScene(Kind::Fault(Fault::Scale(1.25)));
        let cell = scene.cell(0);
        let trial = scene.run(&cell).unwrap();
        assert_eq!(trial, scene.run(&cell).unwrap());
        assert!(!trial.is_accepted());
        let mut names: Vec<String> = AdversarialScene::all()
            .iter()
            .map(AdversarialScene::name)
            .collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), AdversarialScene::all().len());
    }
}
