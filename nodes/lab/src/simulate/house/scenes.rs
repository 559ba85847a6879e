//! The four scenes of the paper: what is looked at, and from where.

use super::House;
use super::regions::Thing;
use crate::AnyError;
use crate::simulate::random::{Purpose, Stream};
use nalgebra::{Point3, Vector3};

/// Distances of a stand from the object, metres; the second is tried when nothing is found.
const DISTANCES_M: [[f64; 2]; 2] = [[1.8, 3.2], [1.0, 4.5]];
/// Places tried.
const TRIES: usize = 80;
/// Points of the object that are looked for.
const SAMPLES: usize = 48;
/// Least share of them that must be seen from the best place.
const SEEN: f64 = 0.12;
/// Chairs this near to a table belong to it, metres.
const CHAIR_M: f64 = 0.9;

/// A scene that a headset looks at (semantic_icp, table 1 of the paper).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Scene {
    /// A television.
    Tv,
    /// A desk.
    Desk,
    /// A bookshelf.
    Bookshelf,
    /// A table with chairs.
    Dining,
}

impl Scene {
    /// All scenes, in the order of the paper.
    pub const ALL: [Scene; 4] = [Scene::Tv, Scene::Desk, Scene::Bookshelf, Scene::Dining];

    /// Name in reports and files.
    pub fn name(self) -> &'static str {
        match self {
            Scene::Tv => "tv",
            Scene::Desk => "desk",
            Scene::Bookshelf => "bookshelf",
            Scene::Dining => "dining",
        }
    }

    /// Class of the object.
    pub fn object(self) -> &'static str {
        match self {
            Scene::Tv => "tv",
            Scene::Desk => "desk",
            Scene::Bookshelf => "bookshelf",
            Scene::Dining => "table",
        }
    }
}

/// A stand and the point that is looked at, house frame, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Stand {
    pub(super) cell_m: [f64; 2],
    pub(super) target_m: Point3<f64>,
    pub(super) instance: u16,
}

/// A free place from which much of the object is seen; which one is up to the seed.
pub(super) fn stand(
    house: &House,
    scene: Scene,
    eye_height_m: f64,
    seed: u64,
) -> Result<Stand, AnyError> {
    let objects = objects(house, scene);
    for distances_m in DISTANCES_M {
        for &number in &objects {
            let found = stand_before(house, number, distances_m, eye_height_m, seed);
            if let Some(stand) = found {
                return Ok(stand);
            }
        }
    }
    let [near_m, far_m] = DISTANCES_M[1];
    Err(format!(
        "no free place from {near_m} to {far_m} m away from which the {} of the scene is seen; does the mesh have \
         one that is labelled so?",
        scene.object()
    )
    .into())
}

/// Numbers of the things of the class, the most telling first: with many chairs, then large.
fn objects(house: &House, scene: Scene) -> Vec<usize> {
    let things = &house.regions.things;
    let chair = house.class("chair");
    let wanted = house.class(scene.object());
    let rank = |thing: &Thing| {
        let near = |other: &&Thing| {
            let apart_m = |axis: usize| {
                let gap = (other.low_m[axis] - thing.high_m[axis])
                    .max(thing.low_m[axis] - other.high_m[axis]);
                gap.max(0.0)
            };
            Some(other.label) == chair && apart_m(0).hypot(apart_m(1)) < CHAIR_M
        };
        let chairs = match scene {
            Scene::Dining => things.iter().filter(near).count(),
            _ => 0,
        };
        let size_m = (0..3).map(|axis| thing.high_m[axis] - thing.low_m[axis]);
        (chairs, size_m.sum::<f64>())
    };
    let of_class = |number: &usize| things.get(*number).map(|t| t.label) == wanted;
    let mut numbers: Vec<usize> = (0..things.len()).filter(of_class).collect();
    numbers.retain(|_| wanted.is_some());
    numbers.sort_by(|&a, &b| {
        let (a, b) = (rank(&things[a]), rank(&things[b]));
        b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
    });
    numbers
}

fn stand_before(
    house: &House,
    number: usize,
    [near_m, far_m]: [f64; 2],
    eye_height_m: f64,
    seed: u64,
) -> Option<Stand> {
    let thing = house.regions.things.get(number)?;
    let middle = [0, 1].map(|axis| (thing.low_m[axis] + thing.high_m[axis]) / 2.0);
    let mut stream = Stream::new(seed, Purpose::HeadsetStand, 0, number as u64);
    let samples = samples(house, number);
    let places = house.free.cells_m.iter().filter(|[x, y]| {
        let distance_m = (x - middle[0]).hypot(y - middle[1]);
        (near_m..=far_m).contains(&distance_m)
    });
    let mut places: Vec<[f64; 2]> = places.copied().collect();
    for i in (1..places.len()).rev() {
        places.swap(i, (stream.uniform() * (i + 1) as f64) as usize);
    }
    places.truncate(TRIES);
    let mut views = Vec::with_capacity(places.len());
    for place in places {
        let eye = house.free.above_m(place, eye_height_m);
        let seen = samples.iter().filter(|p| sees(house, &eye, p, number));
        let seen: Vec<Vector3<f64>> = seen.map(|p| p.coords).collect();
        let share = seen.len() as f64 / samples.len().max(1) as f64;
        let middle = seen.iter().sum::<Vector3<f64>>() / seen.len().max(1) as f64;
        views.push((share, place, middle));
    }
    let best = views.iter().map(|view| view.0).fold(0.0, f64::max);
    if best < SEEN {
        return None;
    }
    views.retain(|view| view.0 >= 0.7 * best);
    let choice = (stream.uniform() * views.len() as f64) as usize;
    let (_, cell_m, target) = *views.get(choice)?;
    Some(Stand {
        cell_m,
        target_m: target.into(),
        instance: thing.instance,
    })
}

/// Points spread evenly over the surface of a thing.
fn samples(house: &House, number: usize) -> Vec<Point3<f64>> {
    let of_thing = house.regions.thing_of.iter().zip(house.mesh().corners_m());
    let of_thing = of_thing.filter(|(thing, _)| **thing as usize == number);
    let mut areas = Vec::new();
    let mut sum_m2 = 0.0;
    for (_, corners) in of_thing {
        let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
        sum_m2 += (b - a).cross(&(c - a)).norm() / 2.0;
        areas.push((sum_m2, [a, b, c]));
    }
    let sample = |i: usize| {
        let upto = (i as f64 + 0.5) / SAMPLES as f64 * sum_m2;
        let at = areas.partition_point(|(area, _)| *area < upto);
        let (_, [a, b, c]) = areas.get(at)?;
        // A sequence of low discrepancy, folded into the triangle.
        let (mut u, mut v) = (
            (i as f64 * 0.754_877_67).fract(),
            (i as f64 * 0.569_840_29).fract(),
        );
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Some(Point3::from(a + (b - a) * u + (c - a) * v))
    };
    (0..SAMPLES).filter_map(sample).collect()
}

/// True if a point of a thing is seen, or the thing right before it.
fn sees(house: &House, eye: &Point3<f64>, point: &Point3<f64>, number: usize) -> bool {
    let ray = point - eye;
    let Some(hit) = house.cast(eye, &ray, ray.norm() + 0.01) else {
        return false;
    };
    let same = house.regions.thing_of.get(hit.triangle) == Some(&(number as u32));
    same && hit.distance_m > ray.norm() - 0.15
}
