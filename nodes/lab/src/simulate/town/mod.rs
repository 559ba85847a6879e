//! A street of a town with crossings, as two lidar scans at different times see it: facades that repeat, parked
//! cars of which some have gone by the second scan, trees and poles.
//!
//! The frame of the town has x along the street and z up, metres. Everything depends on a seed alone.

pub(in crate::simulate) mod solid;

use lattice_core::registration::{LabelDistribution, SemanticCloud};
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use solid::{Form, Solid};

use crate::random::Stream;

/// Classes of points.
const ROAD: u16 = 1;
const SIDEWALK: u16 = 2;
const BUILDING: u16 = 3;
const CAR: u16 = 4;
const VEGETATION: u16 = 5;
const POLE: u16 = 6;

/// Names of the classes of points.
pub const CLASSES: [(u16, &str); 6] = [
    (ROAD, "road"),
    (SIDEWALK, "sidewalk"),
    (BUILDING, "building"),
    (CAR, "car"),
    (VEGETATION, "vegetation"),
    (POLE, "pole"),
];

/// Length of the street on either side of its middle, metres.
const HALF_M: f64 = 150.0;
/// Half the width of the road, and height of the kerb, metres.
const KERB_M: f64 = 6.0;
const KERB_HEIGHT_M: f64 = 0.12;
/// Crossings, and half of their width, metres.
const CROSSINGS_M: [f64; 3] = [-85.0, 5.0, 80.0];
const CROSSING_M: f64 = 8.0;
/// Sectors by which solids are looked up.
const SECTORS: usize = 256;
/// Share of the parked cars that are others at the second time.
const MOVED: f64 = 0.2;

/// A lidar that turns about the vertical.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Lidar {
    /// Beams.
    pub beams: usize,
    /// Lowest and highest beam, radians above level.
    pub elevations_rad: [f64; 2],
    /// Shots of a beam in a turn.
    pub shots: usize,
    /// Farthest return, metres.
    pub range_m: f64,
    /// Standard deviation of ranges, metres.
    pub noise_m: f64,
}

impl Lidar {
    /// Scanner like an HDL-64E, with half of its shots.
    pub const HDL64: Lidar = Lidar {
        beams: 64,
        elevations_rad: [-0.433, 0.035],
        shots: 1000,
        range_m: 80.0,
        noise_m: 0.02,
    };
    /// Scanner like a VLP-16.
    pub const VLP16: Lidar = Lidar {
        beams: 16,
        elevations_rad: [-0.262, 0.262],
        shots: 1800,
        range_m: 80.0,
        noise_m: 0.02,
    };
}

/// Poses of a sensor on the road, `apart_m` along it, in the town: it leans by up to a degree and may look the other way.
pub fn drive(seed: u64, apart_m: f64) -> [Isometry3<f64>; 2] {
    // Above the numbers of the town and its scans.
    let random = &mut Stream::numbered(seed, apart_m.to_bits());
    let first_m = 160.0 * random.uniform() - 100.0;
    [first_m, first_m + apart_m].map(|x_m| {
        let mut lean = || 0.02 * (random.uniform() - 0.5);
        let tilt = Vector3::new(lean(), lean(), 0.0);
        let place = Vector3::new(x_m, 4.0 * random.uniform() - 3.0, 1.73);
        let back = match random.uniform() < 0.3 {
            true => std::f64::consts::PI,
            false => 0.0,
        };
        let yaw = back + 0.3 * (random.uniform() - 0.5);
        Isometry3::new(place, Vector3::z() * yaw) * Isometry3::rotation(tilt)
    })
}

/// A town at two times.
pub struct Town {
    still: Vec<Solid>,
    cars: [Vec<Solid>; 2],
    seed: u64,
}

impl Town {
    /// The town of a seed.
    pub fn new(seed: u64) -> Town {
        let random = &mut Stream::numbered(seed, 1);
        let mut still = Vec::new();
        for side in [-1.0, 1.0] {
            houses(&mut still, side, random);
            greenery(&mut still, side, random);
        }
        for at_m in CROSSINGS_M {
            for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                side_street(&mut still, at_m, x, y, random);
            }
        }
        let mut cars = [Vec::new(), Vec::new()];
        for side in [-1.0, 1.0] {
            park(&mut cars, side, random);
        }
        Town { still, cars, seed }
    }

    /// Scan from a sensor at the first or the second time (0 or 1), in the sensor's frame, with labels.
    pub fn scan(
        &self,
        town_from_sensor: &Isometry3<f64>,
        lidar: &Lidar,
        time: usize,
    ) -> SemanticCloud {
        let eye = Point3::from(town_from_sensor.translation.vector);
        let solids: Vec<&Solid> = self
            .still
            .iter()
            .chain(self.cars.get(time).into_iter().flatten())
            .collect();
        let sectors = sectors(&solids, &eye, lidar.range_m);
        let beam = |beam: usize| {
            let random = &mut Stream::numbered(self.seed, (2 + time as u64) << 16 | beam as u64);
            let [low, high] = lidar.elevations_rad;
            let up = low + (high - low) * beam as f64 / (lidar.beams.max(2) - 1) as f64;
            let mut hits = Vec::new();
            for shot in 0..lidar.shots {
                let turn = std::f64::consts::TAU * shot as f64 / lidar.shots as f64;
                let ray = Vector3::new(up.cos() * turn.cos(), up.cos() * turn.sin(), up.sin());
                let way = town_from_sensor.rotation * ray;
                let (depth, noise) = (random.uniform(), random.normal() * lidar.noise_m);
                let near = sectors
                    .get(sector(way.y.atan2(way.x)))
                    .map_or(&[][..], Vec::as_slice);
                let hit = near
                    .iter()
                    .filter_map(|solid| Some((solid.hit(&eye, &way, depth)?, solid.label)));
                let hit = hit
                    .chain(ground(&eye, &way))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((distance, label)) = hit.filter(|hit| hit.0 < lidar.range_m) {
                    hits.push((
                        Point3::from(ray * (distance + noise)),
                        LabelDistribution::hard(label),
                    ));
                }
            }
            hits
        };
        let hits: Vec<_> = (0..lidar.beams)
            .into_par_iter()
            .flat_map_iter(beam)
            .collect();
        let (points_m, labels) = hits.into_iter().unzip();
        SemanticCloud { points_m, labels }
    }
}

/// The road, or the sidewalk beside it.
fn ground(eye: &Point3<f64>, way: &Vector3<f64>) -> Option<(f64, u16)> {
    let meet = |z: f64| Some((z - eye.z) / way.z).filter(|distance| *distance > 0.0);
    let is_road = |distance: f64| {
        let place = eye + way * distance;
        let crossing = |at_m: &f64| (place.x - at_m).abs() < KERB_M;
        place.y.abs() < KERB_M || CROSSINGS_M.iter().any(crossing)
    };
    let kerb = meet(KERB_HEIGHT_M).filter(|distance| !is_road(*distance));
    match kerb {
        Some(distance) => Some((distance, SIDEWALK)),
        None => meet(0.0).map(|distance| (distance, ROAD)),
    }
}

fn sector(turn_rad: f64) -> usize {
    let part = turn_rad.rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
    (part * SECTORS as f64) as usize % SECTORS
}

/// Solids within reach by the sectors that they are seen in.
fn sectors<'a>(solids: &[&'a Solid], eye: &Point3<f64>, range_m: f64) -> Vec<Vec<&'a Solid>> {
    let mut sectors = vec![Vec::new(); SECTORS];
    for solid in solids {
        let (middle, radius) = solid.circle();
        let off = (middle - eye).xy();
        let distance = off.norm();
        if distance - radius > range_m {
            continue;
        }
        let half = if distance > radius {
            (radius / distance).asin()
        } else {
            std::f64::consts::PI
        };
        // One more on either side for rays of sensors that lean.
        let reach = (half / std::f64::consts::TAU * SECTORS as f64).ceil() as i64 + 1;
        let own = sector(off.y.atan2(off.x)) as i64;
        for i in (own - reach..=own + reach).take(SECTORS) {
            let place = i.rem_euclid(SECTORS as i64) as usize;
            if let Some(sector) = sectors.get_mut(place) {
                sector.push(*solid);
            }
        }
    }
    sectors
}

/// True where a street crosses.
fn crosses(from_m: f64, to_m: f64) -> bool {
    let meets = |at_m: &f64| from_m < at_m + CROSSING_M && to_m > at_m - CROSSING_M;
    CROSSINGS_M.iter().any(meets)
}

fn block(low: [f64; 3], high: [f64; 3], windows: bool, label: u16) -> Solid {
    let ends = [low, high].map(Point3::from);
    let (low, high) = ends[0].coords.inf_sup(&ends[1].coords);
    let form = Form::Block {
        low: low.into(),
        high: high.into(),
        windows,
    };
    Solid { form, label }
}

/// Houses along a side of the street; half of them are like the one before.
fn houses(solids: &mut Vec<Solid>, side: f64, random: &mut Stream) {
    let mut from_m = -HALF_M;
    let (mut width_m, mut back_m, mut height_m) = (9.0, 9.0, 8.0);
    while from_m < HALF_M {
        if random.uniform() < 0.5 {
            width_m = 7.0 + 8.0 * random.uniform();
            back_m = 8.6 + 1.4 * random.uniform();
            height_m = 6.0 + 5.0 * random.uniform();
        }
        if !crosses(from_m, from_m + width_m) {
            let near = [from_m, side * back_m, 0.0];
            let far = [from_m + width_m, side * (back_m + 10.0), height_m];
            solids.push(block(near, far, true, BUILDING));
        }
        let gap_m = if random.uniform() < 0.3 {
            1.0 + 4.0 * random.uniform()
        } else {
            0.0
        };
        from_m += width_m + gap_m;
    }
}

/// Houses along one of the four arms of a crossing.
fn side_street(solids: &mut Vec<Solid>, at_m: f64, x: f64, y: f64, random: &mut Stream) {
    let mut from_m = 20.0 + 2.0 * random.uniform();
    while from_m < 70.0 {
        let width_m = 8.0 + 6.0 * random.uniform();
        let back_m = CROSSING_M + 1.5 * random.uniform();
        let near = [at_m + x * back_m, y * from_m, 0.0];
        let far = [
            at_m + x * (back_m + 9.0),
            y * (from_m + width_m),
            6.0 + 4.0 * random.uniform(),
        ];
        solids.push(block(near, far, true, BUILDING));
        from_m += width_m + 3.0 * random.uniform();
    }
}

/// Trees and poles along a side.
fn greenery(solids: &mut Vec<Solid>, side: f64, random: &mut Stream) {
    let mut pillar = |x: f64, y: f64, radius: f64, height: f64, label: u16| {
        let foot = Point3::new(x, side * y, 0.0);
        let form = Form::Pillar {
            foot,
            radius,
            height,
        };
        solids.push(Solid { form, label });
    };
    let mut crowns = Vec::new();
    let mut x = -HALF_M;
    while x < HALF_M {
        x += 9.0 + 12.0 * random.uniform();
        if crosses(x - 1.0, x + 1.0) {
            continue;
        }
        pillar(x, 7.3, 0.12 + 0.12 * random.uniform(), 4.0, VEGETATION);
        let center = Point3::new(x, side * 7.3, 4.2 + random.uniform());
        let radius = 1.2 + random.uniform();
        crowns.push(Form::Crown { center, radius });
    }
    let mut x = -HALF_M + 10.0 * random.uniform();
    while x < HALF_M {
        pillar(x, 6.5, 0.08, 7.0, POLE);
        x += 24.0 + 4.0 * random.uniform();
    }
    let leaves = |form| Solid {
        form,
        label: VEGETATION,
    };
    solids.extend(crowns.into_iter().map(leaves));
}

/// Cars parked along a side at both times.
fn park(cars: &mut [Vec<Solid>; 2], side: f64, random: &mut Stream) {
    let mut x = -HALF_M;
    while x < HALF_M {
        x += 5.2 + 6.0 * random.uniform() * random.uniform();
        if crosses(x - 2.0, x + 6.0) {
            continue;
        }
        let moved = random.uniform() < MOVED;
        let shift_m = 1.5 * (random.uniform() - 0.5);
        let y = 4.7 + 0.3 * random.uniform();
        for (time, cars) in cars.iter_mut().enumerate() {
            // Another car stands there, or none.
            let x = if moved && time == 1 { x + shift_m } else { x };
            if moved && time == 1 && shift_m < 0.0 {
                continue;
            }
            let part = |from: f64, to: f64, half: f64, z: [f64; 2]| {
                let [near, far] = [y - half, y + half].map(|y| side * y);
                block([x + from, near, z[0]], [x + to, far, z[1]], false, CAR)
            };
            cars.push(part(0.0, 4.3, 0.88, [0.2, 0.85]));
            cars.push(part(1.1, 3.6, 0.8, [0.85, 1.45]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_scans_of_a_street_fit_but_for_the_cars() {
        let town = Town::new(3);
        let sensor = |x| Isometry3::new(Vector3::new(x, -2.0, 1.7), Vector3::z() * 0.3);
        let lidar = Lidar {
            shots: 200,
            noise_m: 0.0,
            ..Lidar::HDL64
        };
        let [first, second] =
            [(0.0, 0), (6.0, 1)].map(|(x, time)| town.scan(&sensor(x), &lidar, time));
        assert!(
            first.len() > 8000 && second.len() > 8000,
            "{} {}",
            first.len(),
            second.len()
        );
        let labels: Vec<u16> = first
            .labels
            .iter()
            .filter_map(LabelDistribution::top)
            .collect();
        for class in [ROAD, SIDEWALK, BUILDING, CAR, VEGETATION, POLE] {
            assert!(labels.contains(&class), "{class}");
        }
        // Points of the road lie on it, walls stand beside it.
        for (point, label) in first.points_m.iter().zip(&labels) {
            let place = sensor(0.0) * point;
            match *label {
                ROAD => assert!(place.z.abs() < 1e-9),
                BUILDING => assert!(place.y.abs() > 8.0),
                _ => {}
            }
        }
    }
}
