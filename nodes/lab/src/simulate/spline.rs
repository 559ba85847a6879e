//! Planar curves through waypoints.

use nalgebra::Vector2;

/// Cubic spline through waypoints with given unit tangents at its ends: twice differentiable, parameter by chord length.
#[derive(Clone, Debug)]
pub(super) struct PlanarSpline {
    points_m: Vec<Vector2<f64>>,
    tangents: Vec<Vector2<f64>>,
    knots: Vec<f64>,
}

impl PlanarSpline {
    /// A clamped spline; None with fewer than two points or with two equal neighbours.
    pub(super) fn new(
        points_m: Vec<Vector2<f64>>,
        start: Vector2<f64>,
        end: Vector2<f64>,
    ) -> Option<Self> {
        let mut knots = vec![0.0];
        let mut length = 0.0;
        for (a, b) in points_m.iter().zip(points_m.iter().skip(1)) {
            let chord = (b - a).norm();
            if chord <= 1e-6 {
                return None;
            }
            length += chord;
            knots.push(length);
        }
        if points_m.len() < 2 {
            return None;
        }
        let tangents = clamped_tangents(&points_m, &knots, start, end);
        Some(Self {
            points_m,
            tangents,
            knots,
        })
    }

    /// Length of the parameter, about that of the curve in metres.
    pub(super) fn length(&self) -> f64 {
        self.knots.last().copied().unwrap_or(0.0)
    }

    /// Point (m) and derivative by the parameter at `u`, clamped to the ends.
    pub(super) fn at(&self, u: f64) -> (Vector2<f64>, Vector2<f64>) {
        let u = u.clamp(0.0, self.length());
        let last = self.knots.len().saturating_sub(2);
        let i = self
            .knots
            .partition_point(|&k| k <= u)
            .saturating_sub(1)
            .min(last);
        let (k0, k1) = (self.knots[i], self.knots[i + 1]);
        let h = k1 - k0;
        let s = (u - k0) / h;
        let (p0, p1) = (self.points_m[i], self.points_m[i + 1]);
        let (m0, m1) = (self.tangents[i] * h, self.tangents[i + 1] * h);
        let (s2, s3) = (s * s, s * s * s);
        let point = p0 * (2.0 * s3 - 3.0 * s2 + 1.0)
            + m0 * (s3 - 2.0 * s2 + s)
            + p1 * (3.0 * s2 - 2.0 * s3)
            + m1 * (s3 - s2);
        let derivative = (p0 * (6.0 * s2 - 6.0 * s)
            + m0 * (3.0 * s2 - 4.0 * s + 1.0)
            + p1 * (6.0 * s - 6.0 * s2)
            + m1 * (3.0 * s2 - 2.0 * s))
            / h;
        (point, derivative)
    }

    /// Greatest length of the derivative, sampled.
    pub(super) fn max_derivative(&self) -> f64 {
        let samples = 64 * self.knots.len();
        (0..=samples)
            .map(|i| self.at(self.length() * i as f64 / samples as f64).1.norm())
            .fold(1e-9, f64::max)
    }
}

/// Tangents that make the second derivative continuous (Thomas algorithm).
fn clamped_tangents(
    points: &[Vector2<f64>],
    knots: &[f64],
    start: Vector2<f64>,
    end: Vector2<f64>,
) -> Vec<Vector2<f64>> {
    let n = points.len();
    let mut tangents = vec![start; n];
    let mut factors = vec![0.0; n];
    for i in 1..n - 1 {
        let (before, after) = (knots[i] - knots[i - 1], knots[i + 1] - knots[i]);
        let right = ((points[i] - points[i - 1]) * (after / before)
            + (points[i + 1] - points[i]) * (before / after))
            * 3.0;
        let pivot = 2.0 * (before + after) - after * factors[i - 1];
        factors[i] = before / pivot;
        tangents[i] = (right - tangents[i - 1] * after) / pivot;
    }
    tangents[n - 1] = end;
    for i in (1..n - 1).rev() {
        tangents[i] = tangents[i] - tangents[i + 1] * factors[i];
    }
    tangents
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bend() -> PlanarSpline {
        let points = [[0.0, 0.0], [10.0, 1.0], [14.0, 9.0], [5.0, 20.0]];
        let points = points.map(Vector2::from).to_vec();
        PlanarSpline::new(points, Vector2::x(), -Vector2::y()).unwrap()
    }

    #[test]
    fn passes_through_the_waypoints_with_the_end_tangents() {
        let spline = bend();
        for (knot, point) in spline.knots.iter().zip(&spline.points_m) {
            assert!((spline.at(*knot).0 - point).norm() < 1e-12);
        }
        assert!((spline.at(0.0).1 - Vector2::x()).norm() < 1e-12);
        assert!((spline.at(spline.length()).1 + Vector2::y()).norm() < 1e-12);
    }

    #[test]
    fn derivative_and_curvature_are_continuous_at_the_waypoints() {
        let spline = bend();
        let h = 1e-5;
        for knot in &spline.knots[1..3] {
            let [before, at, after] = [-h, 0.0, h].map(|h| spline.at(knot + h).1);
            assert!((after - before).norm() < 1e-4);
            assert!(((after - at) / h - (at - before) / h).norm() < 1e-3);
        }
    }

    #[test]
    fn refuses_equal_neighbours() {
        let x = Vector2::x;
        for n in [1, 2] {
            assert!(PlanarSpline::new(vec![x(); n], x(), x()).is_none());
        }
    }
}
