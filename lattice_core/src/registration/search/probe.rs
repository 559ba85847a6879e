//! Sampled points of a source cloud.

use nalgebra::{Point3, Vector3};

use super::field::{FULL, Facing, Field};

/// Maximum number of sampled points: the sum of their scores fits into 16 bits.
const MAX_POINTS: usize = 600;

/// Sampled source points relative to a reference point.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    /// Points relative to the reference point, metres, in the source frame.
    points_m: Vec<Vector3<f64>>,
    kinds: Kinds,
    /// 90 % quantile of the distance from the vertical through the reference point, metres.
    pub radius_m: f64,
}

/// Source of the channel of each point.
#[derive(Clone, Debug)]
enum Kinds {
    Facing(Vec<Facing>),
    Fixed(Vec<usize>),
}

impl Probe {
    /// Samples points; channels follow from their normals.
    pub fn by_surface(
        points_m: &[Point3<f64>],
        normals: &[Vector3<f64>],
        at: &Point3<f64>,
    ) -> Probe {
        let picked = picked(points_m.len());
        let facings = picked.iter().filter_map(|&i| normals.get(i));
        let kinds = Kinds::Facing(facings.map(Facing::of).collect());
        Probe::new(points_m, &picked, kinds, at)
    }

    /// Samples points with given channels; points without a channel are dropped.
    pub fn by_class(
        points_m: &[Point3<f64>],
        channels: &[Option<usize>],
        at: &Point3<f64>,
    ) -> Probe {
        let known: Vec<usize> = (0..points_m.len().min(channels.len()))
            .filter(|&i| channels.get(i).is_some_and(Option::is_some))
            .collect();
        let picked: Vec<usize> = picked(known.len())
            .into_iter()
            .filter_map(|i| known.get(i).copied())
            .collect();
        let kinds = picked.iter().filter_map(|&i| *channels.get(i)?).collect();
        Probe::new(points_m, &picked, Kinds::Fixed(kinds), at)
    }

    fn new(points_m: &[Point3<f64>], picked: &[usize], kinds: Kinds, at: &Point3<f64>) -> Probe {
        let points_m: Vec<Vector3<f64>> = picked
            .iter()
            .filter_map(|&i| Some(points_m.get(i)? - at))
            .collect();
        let mut radii: Vec<f64> = points_m.iter().map(|p| p.xy().norm()).collect();
        radii.sort_by(f64::total_cmp);
        let radius_m = radii.get(radii.len() * 9 / 10).copied().unwrap_or(0.0);
        Probe {
            points_m,
            kinds,
            radius_m,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points_m.len()
    }

    /// Points with their channels at a heading.
    pub fn at_heading(&self, yaw_rad: f64) -> impl Iterator<Item = (Vector3<f64>, usize)> + '_ {
        let points = self.points_m.iter().enumerate();
        points.map(move |(i, p)| (*p, self.channel(i, yaw_rad)))
    }

    fn channel(&self, i: usize, yaw_rad: f64) -> usize {
        match &self.kinds {
            Kinds::Facing(facings) => facings.get(i).map_or(0, |f| f.channel(yaw_rad)),
            Kinds::Fixed(channels) => channels.get(i).copied().unwrap_or(0),
        }
    }

    /// Score at a heading and a position of the reference point, from every `step`-th point; 1 is the full score.
    pub fn score(&self, field: &Field, yaw_rad: f64, place_m: &Vector3<f64>, step: usize) -> f64 {
        let (sin, cos) = yaw_rad.sin_cos();
        let (mut sum, mut n) = (0, 0_u32);
        for (p, channel) in self.at_heading(yaw_rad).step_by(step) {
            let (x, y) = (cos * p.x - sin * p.y, sin * p.x + cos * p.y);
            sum += field.at(channel, &(Vector3::new(x, y, p.z) + place_m));
            n += 1;
        }
        f64::from(sum) / (f64::from(FULL) * f64::from(n.max(1)))
    }
}

/// Indices of at most `MAX_POINTS` of `n` points, evenly spaced.
fn picked(n: usize) -> Vec<usize> {
    let kept = n.min(MAX_POINTS);
    (0..kept).map(|i| i * n / kept).collect()
}
