//! Search over all headings and positions of a cloud in a map, with known gravity.
//!
//! The source is rotated about the vertical in steps. A coarse grid of map scores is correlated with it at all
//! positions. The best peaks are refined by hill climbing on a finer grid. The same search by labels yields a second
//! set of hypotheses. The method is the map matching of MROL (multi-resolution occupied voxel lists); gravity is
//! used as in Quatro (arXiv 2203.06612).

mod correlate;
mod field;
mod grid;
mod occupied;
mod probe;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use correlate::{Peak, Window, best_places};
use field::Field;
use grid::Grid;
use probe::Probe;

use super::PreparedCloud;

pub use occupied::OccupiedGrid;

/// Peaks kept per heading.
const PEAKS_PER_HEADING: usize = 24;
/// Maximum number of source cells in the correlation; more add little.
const MAX_CELLS: usize = 256;
/// Maximum number of source cells in the rough search.
const MAX_CELLS_ROUGH: usize = 96;
/// Maximum number of source cells in the search by labels.
const MAX_CELLS_BY_LABELS: usize = 128;
/// Peaks refined per requested hypothesis.
const CLIMBS_PER_HYPOTHESIS: usize = 3;
/// Target number of points in hill climbing.
const CLIMB_POINTS: usize = 200;
/// Target number of coarse cells; a larger map gets larger cells.
const COARSE_CELLS: f64 = 200_000.0;

/// Region of poses that the search covers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Region {
    /// Central pose, `target_from_source`.
    pub about: Isometry3<f64>,
    /// Largest distance of the reference point from its central position, metres.
    pub radius_m: f64,
    /// Largest difference of the heading from the central one, radians.
    pub yaw_rad: f64,
}

/// Pose hypothesis with its score.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hypothesis {
    /// `target_from_source`: a rotation about the vertical and a translation.
    pub target_from_source: Isometry3<f64>,
    /// Fraction of the full score, 0 to 1.
    pub score: f64,
}

/// Map prepared for the search.
#[derive(Clone, Debug)]
pub struct SearchMap {
    coarse: Field,
    fine: Field,
    /// Maximum number of source cells in the correlation.
    max_cells: usize,
}

impl SearchMap {
    /// Prepares a map with point spacing `spacing_m`, scored by surfaces; `None` if it is empty.
    pub fn of_surfaces(map: &PreparedCloud, spacing_m: f64) -> Option<SearchMap> {
        let (points, normals) = (map.points_m(), map.normals());
        let make = |grid| Field::of_surfaces(grid, points, normals);
        SearchMap::build(points, spacing_m, MAX_CELLS, make)
    }

    /// Prepares a map with cells twice as large, for a fast estimate of the score.
    pub fn rough(map: &PreparedCloud, spacing_m: f64) -> Option<SearchMap> {
        let rough = SearchMap::of_surfaces(map, 2.0 * spacing_m)?;
        Some(SearchMap {
            max_cells: MAX_CELLS_ROUGH,
            ..rough
        })
    }

    /// Prepares a map scored by `channels` source classes: `score(i, channel)`, up to 100, at map point `i`.
    pub fn of_classes(
        map: &PreparedCloud,
        spacing_m: f64,
        channels: usize,
        score: impl Fn(usize, usize) -> u8 + Sync,
    ) -> Option<SearchMap> {
        let points = map.points_m();
        let of_channel = |channel| (0..points.len()).map(|i| score(i, channel)).collect();
        let scores: Vec<Vec<u8>> = (0..channels).into_par_iter().map(of_channel).collect();
        let score = |i: usize, channel: usize| scores.get(channel).and_then(|s| s.get(i));
        let score = |i, channel| score(i, channel).copied().unwrap_or(0);
        let make = |grid| Field::build(grid, points, channels, score);
        SearchMap::build(points, spacing_m, MAX_CELLS_BY_LABELS, make)
    }

    fn build(
        points_m: &[Point3<f64>],
        spacing_m: f64,
        max_cells: usize,
        make: impl Fn(Grid) -> Field,
    ) -> Option<SearchMap> {
        let fine = Grid::around(points_m, 2.0 * spacing_m, 2)?;
        let volume_m3 = fine.len() as f64 * fine.cell_m.powi(3);
        let coarse_m = (volume_m3 / COARSE_CELLS).cbrt().max(2.0 * fine.cell_m);
        Some(SearchMap {
            coarse: make(Grid::around(points_m, coarse_m, 2)?),
            fine: make(fine),
            max_cells,
        })
    }
}

/// Source cloud prepared for the search.
#[derive(Clone, Debug)]
pub struct SearchSource {
    probe: Probe,
    reference_m: Point3<f64>,
}

impl SearchSource {
    /// Prepares a cloud for the search by surfaces.
    ///
    /// The reference point is the sensor if known, else the centroid; the search keeps it within the box of the map.
    pub fn by_surface(source: &PreparedCloud, sensor_m: Option<Point3<f64>>) -> SearchSource {
        let reference_m = reference(source, sensor_m);
        SearchSource {
            probe: Probe::by_surface(source.points_m(), source.normals(), &reference_m),
            reference_m,
        }
    }

    /// Prepares a cloud for the search by classes; points without a channel are dropped.
    pub fn by_class(
        source: &PreparedCloud,
        sensor_m: Option<Point3<f64>>,
        channels: &[Option<usize>],
    ) -> SearchSource {
        let reference_m = reference(source, sensor_m);
        SearchSource {
            probe: Probe::by_class(source.points_m(), channels, &reference_m),
            reference_m,
        }
    }

    /// Pose with heading `yaw_rad` and the reference point at `place_m`.
    fn pose(&self, yaw_rad: f64, place_m: &Vector3<f64>) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        let shift = place_m - turn * self.reference_m.coords;
        Isometry3::from_parts(Translation3::from(shift), turn)
    }
}

/// Position of the sensor if known, else the centroid.
fn reference(source: &PreparedCloud, sensor_m: Option<Point3<f64>>) -> Point3<f64> {
    sensor_m.unwrap_or_else(|| {
        let points = source.points_m();
        let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
        (sum / points.len().max(1) as f64).into()
    })
}

/// Finds up to `most` distinct poses, sorted by descending score.
///
/// `region` limits the search; without it all headings and the whole map are covered.
pub fn search(
    map: &SearchMap,
    source: &SearchSource,
    region: Option<&Region>,
    most: usize,
) -> Vec<Hypothesis> {
    let probe = &source.probe;
    let grid = &map.coarse.grid;
    if probe.len() == 0 {
        return Vec::new();
    }
    let step_rad = (1.5 * grid.cell_m / probe.radius_m.max(grid.cell_m)).clamp(0.035, 0.17);
    let headings = headings(step_rad, region);
    let window = window(grid, source, region);
    let mut peaks: Vec<Peak> = headings
        .into_par_iter()
        .flat_map_iter(|yaw| {
            let most = (map.max_cells, PEAKS_PER_HEADING);
            best_places(&map.coarse, probe.at_heading(yaw), yaw, window, most)
        })
        .collect();
    peaks.sort_by_key(|peak| std::cmp::Reverse(peak.score));
    peaks.truncate(CLIMBS_PER_HYPOTHESIS * most);
    let mut found: Vec<(f64, f64, Vector3<f64>)> = peaks
        .par_iter()
        .map(|peak| {
            hill_climb(
                &map.fine,
                probe,
                peak.yaw_rad,
                peak.place_m,
                grid.cell_m,
                step_rad,
            )
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f64, f64, Vector3<f64>)> = Vec::new();
    for (score, yaw, place) in found {
        let near = |other: &(f64, f64, Vector3<f64>)| {
            (other.2 - place).norm() < 1.5 * map.fine.grid.cell_m
                && angle_between(other.1, yaw) < 0.75 * step_rad
        };
        if kept.len() < most && !kept.iter().any(near) {
            kept.push((score, yaw, place));
        }
    }
    let hypothesis = |(score, yaw, place): (f64, f64, Vector3<f64>)| Hypothesis {
        target_from_source: source.pose(yaw, &place),
        score,
    };
    kept.into_iter().map(hypothesis).collect()
}

/// Headings that cover the region, or all.
fn headings(step_rad: f64, region: Option<&Region>) -> Vec<f64> {
    let turn = std::f64::consts::TAU;
    match region {
        Some(region) if 2.0 * region.yaw_rad < turn => {
            let center = yaw_of(&region.about);
            let half = (region.yaw_rad / step_rad).ceil() as i64;
            (-half..=half)
                .map(|i| center + i as f64 * step_rad)
                .collect()
        }
        _ => {
            let n = (turn / step_rad).ceil() as usize;
            (0..n).map(|i| i as f64 * turn / n as f64).collect()
        }
    }
}

/// Cells that may contain the reference point.
fn window(grid: &Grid, source: &SearchSource, region: Option<&Region>) -> Window {
    let Some(region) = region else {
        return Window {
            first: [0; 3],
            dims: grid.dims,
        };
    };
    let center = (region.about * source.reference_m).coords;
    let reach = Vector3::repeat(region.radius_m);
    let (low, high) = (
        grid.cell_of(&(center - reach)),
        grid.cell_of(&(center + reach)),
    );
    let last = grid.dims.map(|n| n as i64 - 1);
    let first: [i64; 3] = std::array::from_fn(|a| low[a].clamp(0, last[a]));
    Window {
        first: first.map(|c| c as usize),
        dims: std::array::from_fn(|a| (high[a].clamp(0, last[a]) - first[a] + 1) as usize),
    }
}

/// Heading of a pose about the vertical, radians.
pub(in crate::registration) fn yaw_of(pose: &Isometry3<f64>) -> f64 {
    let x = pose.rotation * Vector3::x();
    x.y.atan2(x.x)
}

/// Smallest angle between two headings, radians.
pub(in crate::registration) fn angle_between(a: f64, b: f64) -> f64 {
    let turn = (a - b).rem_euclid(std::f64::consts::TAU);
    turn.min(std::f64::consts::TAU - turn)
}

/// Hill climbing with halved steps from a heading and a position; returns the score, heading and position.
fn hill_climb(
    field: &Field,
    probe: &Probe,
    mut yaw: f64,
    mut place: Vector3<f64>,
    cell_m: f64,
    step_rad: f64,
) -> (f64, f64, Vector3<f64>) {
    let step = probe.len().div_ceil(CLIMB_POINTS);
    let mut best = probe.score(field, yaw, &place, step);
    let (mut shift_m, mut turn_rad) = (cell_m / 2.0, step_rad / 2.0);
    for _ in 0..3 {
        for _ in 0..8 {
            let moves = axis_moves(shift_m);
            let tries = moves
                .into_iter()
                .map(|m| (yaw, place + m))
                .chain([-turn_rad, turn_rad].map(|t| (yaw + t, place)));
            let scored = tries.map(|(y, p)| (probe.score(field, y, &p, step), y, p));
            let Some(top) = scored.max_by(|a, b| a.0.total_cmp(&b.0)) else {
                break;
            };
            if top.0 <= best {
                break;
            }
            (best, yaw, place) = top;
        }
        shift_m /= 2.0;
        turn_rad /= 2.0;
    }
    (probe.score(field, yaw, &place, 1), yaw, place)
}

/// Steps along both directions of all axes.
fn axis_moves(step: f64) -> [Vector3<f64>; 6] {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    std::array::from_fn(|i| axes[i / 2] * if i % 2 == 0 { step } else { -step })
}
