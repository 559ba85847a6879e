//! Scans of a spinning lidar along a route, with motion during each.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::route::Route;
use crate::random::Stream;
use crate::simulate::town::solid::Solid;

/// Duration of a turn, ns.
const TURN_NS: i64 = 100_000_000;
/// Number of sectors by which solids are indexed.
const SECTORS: usize = 128;
/// Bound of the motion of the lidar or a car in half a turn, metres.
const MOVED_M: f64 = 1.0;
/// Number of the first random stream of a scan, above those of scenes.
const SCAN_STREAM: u64 = 1 << 16;

/// Lidar that rotates about the vertical ten times a second.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpinningLidar {
    pub(super) beams: usize,
    pub(super) shots: usize,
    /// Lowest and highest beam, degrees above level.
    pub(super) elevations_deg: [f64; 2],
    pub(super) range_m: f64,
    pub(super) noise_m: f64,
    pub(super) height_m: f64,
}

/// A solid with its velocity, metres per second.
pub(super) struct Moving {
    pub(super) solid: Solid,
    pub(super) velocity: Vector3<f64>,
}

/// A scan in the frame of the lidar.
#[derive(Clone, Debug)]
pub struct DriveScan {
    /// Points, metres.
    pub points_m: Vec<Vector3<f64>>,
    /// Times of the points, nanoseconds since the beginning.
    pub times_ns: Vec<i64>,
    /// Time of the last shot, nanoseconds since the beginning.
    pub end_ns: i64,
}

/// A drive through a scene.
pub struct Drive {
    pub(super) seed: u64,
    pub(super) lidar: SpinningLidar,
    pub(super) solids: Vec<Solid>,
    pub(super) moving: Vec<Moving>,
    pub(super) route: Route,
    /// Scans without a return, and scans that are missing.
    pub(super) blank: std::ops::Range<i64>,
    pub(super) missing: std::ops::Range<i64>,
}

impl Drive {
    /// Numbers of the scans, in order of time.
    pub fn scans(&self) -> impl Iterator<Item = i64> + '_ {
        let count = (self.route.duration_s() * 1e9) as i64 / TURN_NS;
        (1..=count).filter(|i| !self.missing.contains(i))
    }

    /// True pose of the lidar at a time, nanoseconds since the beginning.
    pub fn pose(&self, time_ns: i64) -> Isometry3<f64> {
        self.route.pose(time_ns as f64 * 1e-9, self.lidar.height_m)
    }

    /// Simulates the scan of a number.
    pub fn scan(&self, number: i64) -> DriveScan {
        let end_ns = number * TURN_NS;
        let middle_ns = end_ns - TURN_NS / 2;
        let eye = Point3::from(self.pose(middle_ns).translation.vector);
        let moving = self.moving.iter().map(|moving| moving.at(middle_ns));
        let moving: Vec<Solid> = moving.collect();
        let still = self.solids.iter().map(|solid| (solid, Vector3::zeros()));
        let moving = moving.iter().zip(&self.moving);
        let moving = moving.map(|(solid, moving)| (solid, moving.velocity));
        let sectors = sectors(still.chain(moving), &eye, self.lidar.range_m);
        let shots = if self.blank.contains(&number) {
            0
        } else {
            self.lidar.shots
        };
        let shots: Vec<Vec<(Vector3<f64>, i64)>> = (0..shots)
            .into_par_iter()
            .map(|shot| self.shot(shot, end_ns, middle_ns, number, &sectors))
            .collect();
        let (points_m, times_ns) = shots.into_iter().flatten().unzip();
        DriveScan {
            points_m,
            times_ns,
            end_ns,
        }
    }

    fn shot(
        &self,
        shot: usize,
        end_ns: i64,
        middle_ns: i64,
        number: i64,
        sectors: &[Vec<(&Solid, Vector3<f64>)>],
    ) -> Vec<(Vector3<f64>, i64)> {
        let lidar = &self.lidar;
        let time_ns = end_ns - TURN_NS + TURN_NS * (shot as i64 + 1) / lidar.shots as i64;
        let pose = self.pose(time_ns);
        let since_s = (time_ns - middle_ns) as f64 * 1e-9;
        let random = &mut Stream::numbered(self.seed, SCAN_STREAM * number as u64 + shot as u64);
        let turn = TAU * shot as f64 / lidar.shots as f64;
        let mut hits = Vec::new();
        for beam in 0..lidar.beams {
            let [low, high] = lidar.elevations_deg;
            let part = beam as f64 / (lidar.beams - 1) as f64;
            let up = (low + (high - low) * part).to_radians();
            let ray = Vector3::new(up.cos() * turn.cos(), up.cos() * turn.sin(), up.sin());
            let way = pose.rotation * ray;
            let (depth, noise) = (random.uniform(), random.normal() * lidar.noise_m);
            let near = sectors.get(sector(way.y.atan2(way.x)));
            let hit = near.into_iter().flatten().filter_map(|(solid, velocity)| {
                let eye = Point3::from(pose.translation.vector - velocity * since_s);
                solid.hit(&eye, &way, depth)
            });
            // The ground is at 0.
            let ground = Some(-pose.translation.z / way.z).filter(|distance| *distance > 0.0);
            let distance = hit.chain(ground).fold(f64::INFINITY, f64::min);
            if distance < lidar.range_m {
                hits.push((ray * (distance + noise), time_ns));
            }
        }
        hits
    }
}

impl Moving {
    fn at(&self, time_ns: i64) -> Solid {
        let moved = self.velocity * (time_ns as f64 * 1e-9);
        self.solid.moved(&moved)
    }
}

fn sector(turn_rad: f64) -> usize {
    (turn_rad.rem_euclid(TAU) / TAU * SECTORS as f64) as usize % SECTORS
}

/// Solids within reach, by the sectors that they may be seen in while the lidar and they move.
fn sectors<'a>(
    solids: impl Iterator<Item = (&'a Solid, Vector3<f64>)>,
    eye: &Point3<f64>,
    range_m: f64,
) -> Vec<Vec<(&'a Solid, Vector3<f64>)>> {
    let mut sectors = vec![Vec::new(); SECTORS];
    for (solid, velocity) in solids {
        let (middle, radius) = solid.circle();
        let radius = radius + 2.0 * MOVED_M;
        let off = (middle - eye).xy();
        let distance = off.norm();
        if distance - radius > range_m {
            continue;
        }
        let half = match distance > radius {
            true => (radius / distance).asin(),
            false => std::f64::consts::PI,
        };
        // One more on either side for rays of lidars that lean.
        let reach = (half / TAU * SECTORS as f64).ceil() as i64 + 1;
        let own = sector(off.y.atan2(off.x)) as i64;
        for i in (own - reach..=own + reach).take(SECTORS) {
            let place = i.rem_euclid(SECTORS as i64) as usize;
            if let Some(sector) = sectors.get_mut(place) {
                sector.push((solid, velocity));
            }
        }
    }
    sectors
}
