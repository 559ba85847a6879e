//! Adversarial scenes: rooms that look alike from several places, and misdeclared clouds.

use crate::evaluate::views::{any_pose, keep_sector, signed};
use crate::random::Stream;
use crate::simulate::rooms::{Flat, LOOKS};
use lattice_core::pose::Axes;
use lattice_core::registration::{CalibrationOptions, SemanticCloud, SourceCloud};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

/// Kinds of adversarial scenes, the first part of a scene's name.
pub(super) const ALIKE: &str = "alike";
pub(super) const BROKEN: &str = "broken";
pub(super) const NEARLY: &str = "nearly alike";
pub(super) const WRONG_INPUT: &str = "wrong input";

/// A map and a scan, with the truth.
pub(super) struct Scene {
    pub map: SemanticCloud,
    pub scan: SourceCloud,
    pub options: CalibrationOptions,
    pub truth: Isometry3<f64>,
}

impl Scene {
    /// A noisy map of a room, and a scan all around from a place in it.
    fn all_around(
        room: &Flat,
        eye_m: [f64; 2],
        truth: Isometry3<f64>,
        random: &mut Stream,
    ) -> Scene {
        let uniform = &mut || random.uniform();
        Scene {
            map: room.noisy_map(uniform),
            scan: room.all_around(eye_m, &truth, uniform),
            options: CalibrationOptions::default(),
            truth,
        }
    }

    fn without_labels(mut self) -> Scene {
        self.map.labels.clear();
        self.scan.cloud.labels.clear();
        self
    }
}

/// A room that looks alike from several places, and how far from its middle a scan is taken, metres.
type Shape = (&'static str, fn() -> Flat, [f64; 2]);

const SHAPES: [Shape; 10] = [
    ("room of 12 m x 7 m", || Flat::room(12.0, 7.0), [4.0, 2.0]),
    ("room of 6 m x 4 m", || Flat::room(6.0, 4.0), [2.0, 1.0]),
    ("room of 5 m x 5 m", || Flat::room(5.0, 5.0), [1.5, 1.5]),
    (
        "corridor of 20 m x 2.5 m",
        || Flat::room(20.0, 2.5),
        [3.0, 0.4],
    ),
    ("hall of 25 m x 15 m", || Flat::room(25.0, 15.0), [5.0, 4.0]),
    (
        "3 rooms of 4 m x 4 m",
        || Flat::row_of_rooms(3, 4.0),
        [1.0, 1.0],
    ),
    (
        "5 rooms of 3 m x 3 m",
        || Flat::row_of_rooms(5, 3.0),
        [0.7, 0.7],
    ),
    ("silo of 90 panels", || Flat::silo(4.0, 90), [1.5, 1.5]),
    ("octagon", || Flat::silo(4.0, 8), [1.5, 1.5]),
    ("stairs of 24 steps", || Flat::stairs(24), [1.0, 0.3]),
];

/// Fault of a cloud.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Fault {
    /// Axes it has and those it is read as.
    Axes(Axes, Axes),
    /// Factor on its lengths.
    Scale(f64),
    /// Lean, degrees.
    Tilt(f64),
    /// One axis has the wrong sign.
    Mirrored,
    /// Taken in another building.
    Elsewhere,
}

impl Fault {
    pub fn all() -> Vec<Fault> {
        let pairs = Axes::ALL.into_iter().flat_map(|has| {
            let others = Axes::ALL.into_iter().filter(move |read| *read != has);
            others.map(move |read| Fault::Axes(has, read))
        });
        let mut all: Vec<Fault> = pairs.collect();
        all.extend([0.8, 0.9, 0.95, 1.05, 1.1, 1.25].map(Fault::Scale));
        all.extend([5.0, 10.0, 20.0].map(Fault::Tilt));
        all.extend([Fault::Mirrored, Fault::Elsewhere]);
        all
    }

    pub fn name(self) -> String {
        match self {
            Fault::Axes(has, read) => format!("{has} read as {read}"),
            Fault::Scale(by) => format!("scaled by {by}"),
            Fault::Tilt(degrees) => format!("leaning by {degrees} degrees"),
            Fault::Mirrored => "mirrored".to_owned(),
            Fault::Elsewhere => "of another building".to_owned(),
        }
    }

    /// Tests whether the reason of a result names this fault.
    pub fn is_named_by(self, reason: &str) -> bool {
        let any = |parts: &[&str]| parts.iter().any(|part| reason.contains(part));
        match self {
            Fault::Axes(has, _) => reason.contains(&format!("fits as {has}")),
            Fault::Scale(_) => any(&["scale"]),
            Fault::Tilt(_) => any(&["leans"]),
            Fault::Mirrored => any(&["mirrored", "fits as"]),
            Fault::Elsewhere => any(&["lie on the map", "another pose", "no place"]),
        }
    }

    /// View into the flat with this fault.
    pub fn scene(self, seed: u64, random: &mut Stream) -> Scene {
        let flat = Flat::default();
        let truth = any_pose(random);
        // The last look is at a bare wall.
        let number = (seed % (LOOKS.len() as u64 - 1)) as usize;
        let (place, yaw) = LOOKS.get(number).copied().unwrap_or_default();
        let moved = Vector3::new(signed(random), signed(random), 0.0) * 0.2;
        let yaw = yaw + 0.2 * signed(random);
        let (building, eye) = match self {
            Fault::Elsewhere => (elsewhere(), Point3::new(0.0, 0.0, 1.6) + moved),
            _ => (flat.clone(), Point3::from(place) + moved),
        };
        let mut cloud = building.look(eye, yaw, &truth);
        let mut map = flat.map();
        if seed % 2 == 1 {
            cloud.labels.clear();
            map.labels.clear();
        }
        let axis = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * Vector3::x_axis();
        let change = |p: Vector3<f64>| match self {
            Fault::Axes(has, read) => read.to_ros(has.from_ros(p)),
            Fault::Scale(by) => p * by,
            Fault::Tilt(degrees) => {
                UnitQuaternion::from_axis_angle(&axis, degrees.to_radians()) * p
            }
            Fault::Mirrored => Vector3::new(p.x, -p.y, p.z),
            Fault::Elsewhere => p,
        };
        let mut scan = SourceCloud {
            cloud,
            sensor_m: Some(truth.inverse() * eye),
        };
        let points = scan.cloud.points_m.iter_mut().chain(&mut scan.sensor_m);
        points.for_each(|p| p.coords = change(p.coords));
        let axes = match self {
            Fault::Axes(_, read) => read,
            _ => Axes::RosFlu,
        };
        Scene {
            map,
            scan,
            options: CalibrationOptions {
                axes,
                ..CalibrationOptions::default()
            },
            truth,
        }
    }
}

/// A scan in a room that looks alike from several places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    shape: Shape,
    /// True for a scan all around, else of a sixth of the circle.
    whole: bool,
    pub object: Object,
    labelled: bool,
}

/// Object in a room that breaks its symmetry.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Object {
    None,
    /// A box as large as a chair.
    Box,
    /// A cube of 20 to 60 cm, possibly too small to break the symmetry.
    Cube,
}

impl Look {
    pub fn all() -> Vec<Look> {
        let mut all = Vec::new();
        for shape in SHAPES {
            let look = |whole, object, labelled| Look {
                shape,
                whole,
                object,
                labelled,
            };
            for labelled in [false, true] {
                all.push(look(true, Object::None, labelled));
                all.push(look(false, Object::None, labelled));
                all.push(look(true, Object::Box, labelled));
            }
            all.push(look(true, Object::Cube, false));
        }
        all
    }

    pub fn name(self) -> String {
        let view = if self.whole { "whole" } else { "in part" };
        let labels = if self.labelled { "labels" } else { "no labels" };
        format!("{}, {view}, {labels}", self.shape.0)
    }

    pub fn scene(self, random: &mut Stream) -> Scene {
        let (_, room, reach_m) = self.shape;
        let truth = any_pose(random);
        // An object needs room beside who looks at it.
        let reach = match self.object {
            Object::None => 1.0,
            Object::Box | Object::Cube => 0.3,
        };
        let eye = reach_m.map(|most| most * reach * signed(random));
        let with_box = |size_m| room().with_box([eye[0] + 1.0, eye[1] + 0.1], size_m);
        let room = match self.object {
            Object::None => room(),
            Object::Box => with_box([0.5, 0.5, 0.9]),
            Object::Cube => with_box([0.2 + 0.4 * random.uniform(); 3]),
        };
        let mut scene = Scene::all_around(&room, eye, truth, random);
        if !self.whole {
            keep_sector(&mut scene.scan, 0.52, random);
        }
        match self.labelled {
            true => scene,
            false => scene.without_labels(),
        }
    }
}

/// Panoramic scan in a small room, empty or with a cube that may be too small to break the symmetry.
///
/// Its axes are trusted, so that thousands are registered in an hour.
pub(super) fn small_room(object: Object, random: &mut Stream) -> Scene {
    let truth = any_pose(random);
    let sides = [(); 2].map(|()| 2.0 + 2.0 * random.uniform());
    let eye = sides.map(|side| 0.25 * side * signed(random));
    let room = Flat::room(sides[0], sides[1]);
    let room = match object {
        Object::None => room,
        Object::Box | Object::Cube => {
            let size = 0.1 + 0.3 * random.uniform();
            let corner = sides.map(|side| (side - size) * random.uniform() - side / 2.0);
            room.with_box(corner, [size; 3])
        }
    };
    let mut scene = Scene::all_around(&room, eye, truth, random).without_labels();
    scene.options.trust_axes = true;
    scene.options.registered_points = 2_000;
    scene
}

/// Another building.
fn elsewhere() -> Flat {
    Flat::room(7.0, 5.0)
        .with_box([1.0, 0.5], [0.6, 1.4, 0.8])
        .with_box([-2.0, -1.5], [1.2, 0.5, 1.7])
}
