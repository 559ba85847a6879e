//! A spinning scanner of 64 beams, like an Ouster OS1-64: 1024 columns ten times a second.

use super::random::Stream;
use super::site::{Hit, Site};
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::TAU;

/// Columns of one turn.
pub(super) const COLUMNS: usize = 1024;
/// Beams of a column.
const BEAMS: usize = 64;
/// One turn, ns.
pub(super) const TURN_NS: i64 = 100_000_000;
/// Elevation of the outer beams, degrees; the others lie evenly between.
const OUTER_ELEVATION_DEG: f64 = 22.5;
const MIN_RANGE_M: f64 = 0.8;
const MAX_RANGE_M: f64 = 120.0;
/// Standard deviation of a range, m.
const RANGE_NOISE_M: f64 = 0.012;
/// Least `reflectivity cos(incidence) / range^2` (1/m^2) that gives a return: a target of 10 % is seen to 80 m.
const SENSITIVITY_PER_M2: f64 = 0.1 / (80.0 * 80.0);

/// One return: point in the scanner's frame with range noise (m), and intensity 0..255.
pub(super) type Return = (Vector3<f64>, f64);

/// Time of a column since the first one, ns.
pub(super) fn column_offset_ns(column: usize) -> i64 {
    column as i64 * TURN_NS / COLUMNS as i64
}

/// The directions of all beams of all columns, scanner's frame: counter-clockwise from x.
pub(super) fn directions() -> Vec<[Vector3<f64>; BEAMS]> {
    let elevations = std::array::from_fn::<f64, BEAMS, _>(|beam| {
        let step_deg = 2.0 * OUTER_ELEVATION_DEG / (BEAMS - 1) as f64;
        (OUTER_ELEVATION_DEG - step_deg * beam as f64).to_radians()
    });
    let column = |column: usize| {
        let (sin, cos) = (TAU * column as f64 / COLUMNS as f64).sin_cos();
        elevations.map(|e| Vector3::new(cos * e.cos(), sin * e.cos(), e.sin()))
    };
    (0..COLUMNS).map(column).collect()
}

/// Measures one column from the pose `map_from_scanner`. `own_body_m` gives the distance at which a
/// beam meets the carrying machine.
pub(super) fn column(
    site: &Site,
    directions: &[Vector3<f64>],
    map_from_scanner: &Isometry3<f64>,
    noise: &mut Stream,
    own_body_m: impl Fn(&Vector3<f64>) -> Option<f64>,
    mut visit: impl FnMut(Return),
) {
    let origin = map_from_scanner.translation.vector;
    for in_scanner in directions {
        // Drawn for every beam, so that what a beam meets does not change the noise of the others.
        let error_m = RANGE_NOISE_M * noise.normal();
        let direction = map_from_scanner.rotation * in_scanner;
        let Some(hit) = site.cast(&origin, &direction, MAX_RANGE_M) else {
            continue;
        };
        if seen(&hit) && own_body_m(in_scanner).is_none_or(|body_m| body_m > hit.range_m) {
            let intensity = 255.0 * hit.reflectivity * hit.cos_incidence;
            visit((in_scanner * (hit.range_m + error_m), intensity));
        }
    }
}

fn seen(hit: &Hit) -> bool {
    let echo = hit.reflectivity * hit.cos_incidence;
    hit.range_m >= MIN_RANGE_M && echo >= SENSITIVITY_PER_M2 * hit.range_m * hit.range_m
}
