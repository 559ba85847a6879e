//! A laser scanner that stands in the house and looks all around.

use super::House;
use super::free_space::NO_FREE_SPACE;
use crate::AnyError;
use crate::simulate::random::{Purpose, Stream};
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Directions all around, and up and down: a nodding scanner on a robot that stops every half metre or so.
const COLUMNS: usize = 480;
const ROWS: usize = 96;
/// Elevation of the outermost rows, degrees.
const ELEVATION_DEG: f64 = 45.0;
/// Height above the floor, metres.
const HEIGHT_M: f64 = 1.0;
/// Farthest return, metres.
const MAX_RANGE_M: f64 = 30.0;
/// Distances between the stands of a pair, metres.
const APART_M: std::ops::RangeInclusive<f64> = 0.4..=0.9;
/// Largest turn of the heading within a pair, degrees.
const TURN_DEG: f64 = 30.0;

/// A scanner's view from a stand, without errors.
#[derive(Clone, PartialEq, Debug)]
pub struct LaserView {
    /// Pose of the scanner.
    pub house_from_laser: Isometry3<f64>,
    /// Unit vectors, scanner's frame, and how far the surfaces are, metres.
    rays: Vec<(Vector3<f64>, f64)>,
}

impl LaserView {
    /// Looks around from a pose in the house; the x axis of the scanner is forward, z up.
    fn new(house: &House, house_from_laser: &Isometry3<f64>) -> LaserView {
        let origin_m = Point3::from(house_from_laser.translation.vector);
        let ray = |number: usize| {
            let (column, row) = (number / ROWS, number % ROWS);
            let azimuth = TAU * column as f64 / COLUMNS as f64;
            let height = 2.0 * (row as f64 + 0.5) / ROWS as f64 - 1.0;
            let elevation = (ELEVATION_DEG * height).to_radians();
            let ((sin, cos), (up, along)) = (azimuth.sin_cos(), elevation.sin_cos());
            let ray = Vector3::new(cos * along, sin * along, up);
            let direction = house_from_laser.rotation * ray;
            let range_m = house.depth_m(&origin_m, &direction, MAX_RANGE_M)?;
            Some((ray, range_m))
        };
        let rays = (0..COLUMNS * ROWS).into_par_iter();
        LaserView {
            house_from_laser: *house_from_laser,
            rays: rays.filter_map(ray).collect(),
        }
    }

    /// Views from pairs of stands all over the house, both of a pair in sight of each other.
    pub fn pairs(house: &House, pairs: usize, seed: u64) -> Result<Vec<[LaserView; 2]>, AnyError> {
        let mut stream = Stream::new(seed, Purpose::LaserStand, 0, 0);
        let firsts = house.free.spread_m(pairs, || stream.uniform());
        let pair = |first_m: [f64; 2]| {
            let yaw = TAU * stream.uniform();
            let turn = (TURN_DEG * (2.0 * stream.uniform() - 1.0)).to_radians();
            let from = house.free.above_m(first_m, HEIGHT_M);
            let seconds: Vec<Point3<f64>> = (house.free.cells_m.iter())
                .map(|&cell| house.free.above_m(cell, HEIGHT_M))
                .filter(|to| in_reach(house, &from, to))
                .collect();
            let drawn = (stream.uniform() * seconds.len() as f64) as usize;
            let to = seconds.get(drawn)?;
            let first = super::camera::looking(from, yaw, 0.0);
            let second = super::camera::looking(*to, yaw + turn, 0.0);
            let view = |pose| LaserView::new(house, &pose);
            Some([view(first), view(second)])
        };
        let made: Vec<_> = firsts.into_iter().filter_map(pair).collect();
        match made.is_empty() {
            true => Err(NO_FREE_SPACE.into()),
            false => Ok(made),
        }
    }

    /// One scan, scanner's frame, metres: ranges with normal errors of `noise_m`, by stream `number`
    /// of the seed.
    pub fn scan(&self, noise_m: f64, seed: u64, number: u64) -> Vec<[f32; 3]> {
        let mut stream = Stream::new(seed, Purpose::LaserScan, 0, number);
        let point = |(ray, range_m): &(Vector3<f64>, f64)| {
            let point = ray * (range_m + noise_m * stream.normal());
            point.map(|x| x as f32).into()
        };
        self.rays.iter().map(point).collect()
    }
}

fn in_reach(house: &House, from: &Point3<f64>, to: &Point3<f64>) -> bool {
    let way = to - from;
    let apart = way.norm();
    APART_M.contains(&apart) && house.depth_m(from, &way, apart).is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_of_a_pair_show_one_place() {
        let house = House::generated(3).unwrap();
        let pairs = LaserView::pairs(&house, 5, 4).unwrap();
        assert_eq!(pairs, LaserView::pairs(&house, 5, 4).unwrap());
        assert_eq!(pairs.len(), 5);
        for (number, [first, second]) in (0..).zip(&pairs) {
            let between = first.house_from_laser.inverse() * second.house_from_laser;
            let apart = between.translation.vector.norm();
            assert!((0.4..=0.9).contains(&apart) && between.rotation.angle() <= 0.53);
            for view in [first, second] {
                let exact = view.scan(0.0, 1, number);
                assert_eq!(exact.len(), COLUMNS * ROWS);
                for p in exact.iter().step_by(7) {
                    let p = view.house_from_laser * Point3::from(p.map(f64::from));
                    assert!((-0.2..20.2).contains(&p.x) && (-0.2..12.2).contains(&p.y));
                    assert!((-0.01..2.81).contains(&p.z));
                }
                let noisy = view.scan(0.02, 1, number);
                let off = |(a, b): (&[f32; 3], &[f32; 3])| {
                    let change = Vector3::from(*a) - Vector3::from(*b);
                    f64::from(change.norm_squared())
                };
                let sum: f64 = exact.iter().zip(&noisy).map(off).sum();
                let rms = (sum / exact.len() as f64).sqrt();
                assert!((rms - 0.02).abs() < 0.002, "{rms}");
                assert_ne!(noisy, view.scan(0.02, 1, number + 1));
            }
        }
    }
}
