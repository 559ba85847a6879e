//! Corners of a way, and points along them.

use nalgebra::Vector3;

use super::surface_steps::{Place, Steps};

/// Corners of a way that is shortened by lines of sight; `None` once `go_on` returns false.
///
/// Each place is connected to the last visible one of its run, so that there are as many lines as places.
pub(super) fn corners(
    steps: &Steps<'_>,
    way: &[Place],
    mut go_on: impl FnMut() -> bool,
) -> Option<Vec<Place>> {
    let (&first, rest) = way.split_first()?;
    let (mut corners, mut from, mut seen) = (vec![first], first, first);
    for &to in rest {
        if !go_on() {
            return None;
        }
        if seen != from && steps.line(from, to).is_none() {
            corners.push(seen);
            from = seen;
        }
        seen = to;
    }
    if seen != first {
        corners.push(seen);
    }
    Some(corners)
}

/// Points from corner to corner, one a column or row, at the heights of the surfaces.
pub(super) fn points(steps: &Steps<'_>, corners: &[Place]) -> Vec<Vector3<f64>> {
    let mut points: Vec<_> = corners
        .first()
        .map(|at| steps.point_m(*at))
        .into_iter()
        .collect();
    for (&from, &to) in corners.iter().zip(corners.iter().skip(1)) {
        let line = steps.line(from, to).unwrap_or_default();
        let ([x0, y0], [x1, y1]) = (steps.column(from), steps.column(to));
        let count = x0.abs_diff(x1).max(y0.abs_diff(y1));
        let (from_m, to_m) = (steps.point_m(from), steps.point_m(to));
        let mut touched = line.iter().peekable();
        for i in 1..count {
            let part = f64::from(i) / f64::from(count);
            let along = |a: i32, b: i32| (f64::from(a) + part * f64::from(b - a)).round() as i32;
            let column = [along(x0, x1), along(y0, y1)];
            while touched
                .peek()
                .is_some_and(|at| steps.column(**at) != column)
            {
                touched.next();
            }
            let mut point_m = from_m + part * (to_m - from_m);
            if let Some(at) = touched.peek() {
                point_m.z = steps.point_m(**at).z;
            }
            points.push(point_m);
        }
        points.push(to_m);
    }
    points
}
