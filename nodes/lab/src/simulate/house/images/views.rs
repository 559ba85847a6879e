//! Poses of a headset's camera all over a house.

use crate::AnyError;
use crate::options::within;
use crate::simulate::house::House;
use crate::simulate::house::camera::looking;
use crate::simulate::house::regions::Thing;
use crate::simulate::random::{Purpose, Stream};
use nalgebra::{Isometry3, Point3};

/// Heights of eyes above the floor, metres.
const EYES_M: [f64; 2] = [1.45, 1.75];
/// Distances of what is looked at, metres.
const APART_M: [f64; 2] = [1.0, 4.5];
/// Looks that are tried for each view.
const TRIES: usize = 40;

/// Poses of the camera of someone who walks about and looks at things, house frame: x forward, y left, z up.
pub fn look_views(house: &House, views: usize, seed: u64) -> Result<Vec<Isometry3<f64>>, AnyError> {
    within("views", views as f64, 1.0, 2e4)?;
    let view = |number: usize| {
        let mut stream = Stream::new(seed, Purpose::LookView, 0, number as u64);
        let mut last = Isometry3::identity();
        for _ in 0..TRIES {
            let (pose, apart_m) = look(house, &mut stream);
            last = pose;
            if (APART_M[0]..APART_M[1]).contains(&apart_m) {
                break;
            }
        }
        last
    };
    Ok((0..views).map(view).collect())
}

/// A view from a free place towards an object, and their distance.
fn look(house: &House, stream: &mut Stream) -> (Isometry3<f64>, f64) {
    let mut between = |low: f64, high: f64| low + (high - low) * stream.uniform();
    let cells = &house.free.cells_m;
    let cell = cells.get((between(0.0, 1.0) * cells.len() as f64) as usize);
    let eye_m = house
        .free
        .above_m(*cell.unwrap_or(&[0.0; 2]), between(EYES_M[0], EYES_M[1]));
    // Walls are many, and in most looks anyway.
    let things = house.regions.things.iter();
    let things: Vec<&Thing> = things.filter(|thing| !thing.is_structural()).collect();
    let thing = things.get((between(0.0, 1.0) * things.len() as f64) as usize);
    let target_m = thing.map_or(eye_m, |thing| {
        Point3::from([0, 1, 2].map(|i| between(thing.low_m[i], thing.high_m[i])))
    });
    let way = target_m - eye_m;
    let yaw = way.y.atan2(way.x) + between(-12.0, 12.0).to_radians();
    let pitch = way.z.atan2(way.x.hypot(way.y)) + between(-8.0, 8.0).to_radians();
    let pitch = pitch.clamp(-0.9, 0.5);
    (looking(eye_m, yaw, pitch), way.norm())
}
