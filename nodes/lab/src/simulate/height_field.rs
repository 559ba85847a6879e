//! Ground as a triangulated grid of heights, with exact ray casting.

use nalgebra::{Vector2, Vector3};

/// Heights on a square grid; each square is two triangles parted by the diagonal from its lower to its upper corner.
#[derive(Clone, Debug)]
pub struct HeightField {
    origin_m: Vector2<f64>,
    spacing_m: f64,
    columns: usize,
    rows: usize,
    heights_m: Vec<f64>,
}

impl HeightField {
    /// Samples `height_m(x, y)` over squares of `spacing_m` from `origin_m`; at least one square each way.
    pub fn from_fn(
        origin_m: Vector2<f64>,
        spacing_m: f64,
        squares: [usize; 2],
        height_m: impl Fn(usize, usize, Vector2<f64>) -> f64,
    ) -> Self {
        let (columns, rows) = (squares[0].max(1), squares[1].max(1));
        let mut heights_m = Vec::with_capacity((columns + 1) * (rows + 1));
        for row in 0..=rows {
            for column in 0..=columns {
                let point = origin_m + Vector2::new(column as f64, row as f64) * spacing_m;
                heights_m.push(height_m(column, row, point));
            }
        }
        Self {
            origin_m,
            spacing_m,
            columns,
            rows,
            heights_m,
        }
    }

    pub fn squares(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    pub fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// Corner with the least x and y, m.
    pub fn origin_m(&self) -> Vector2<f64> {
        self.origin_m
    }

    /// Height of the surface, None outside the grid.
    #[cfg(test)]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let ([column, row], u, v) = self.square_at(x_m, y_m)?;
        Some(self.height_in_square(column, row, u, v))
    }

    /// Upward unit normal of the triangle at a point, None outside the grid.
    pub fn normal(&self, x_m: f64, y_m: f64) -> Option<Vector3<f64>> {
        let ([column, row], u, v) = self.square_at(x_m, y_m)?;
        let [low, right, left, high] = self.corners(column, row);
        let (du, dv) = match u >= v {
            true => (right - low, high - right),
            false => (high - left, left - low),
        };
        Some(Vector3::new(-du, -dv, self.spacing_m).normalize())
    }

    /// The square of a point and its place in it, None outside the grid.
    fn square_at(&self, x_m: f64, y_m: f64) -> Option<([usize; 2], f64, f64)> {
        let u = (x_m - self.origin_m.x) / self.spacing_m;
        let v = (y_m - self.origin_m.y) / self.spacing_m;
        let inside = u >= 0.0 && v >= 0.0 && u <= self.columns as f64 && v <= self.rows as f64;
        let column = (u as usize).min(self.columns - 1);
        let row = (v as usize).min(self.rows - 1);
        inside.then_some(([column, row], u - column as f64, v - row as f64))
    }

    /// Highest corner in the squares `from` to `to` (exclusive).
    pub fn max_height_m(&self, from: [usize; 2], to: [usize; 2]) -> f64 {
        let mut highest = f64::NEG_INFINITY;
        for row in from[1]..=to[1].min(self.rows) {
            for column in from[0]..=to[0].min(self.columns) {
                highest = highest.max(self.corner(column, row));
            }
        }
        highest
    }

    /// Distance along the ray from above to the surface, within `from_m..to_m` of the ray; `direction` is a unit vector.
    pub fn cast(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        from_m: f64,
        to_m: f64,
    ) -> Option<f64> {
        let scale = 1.0 / self.spacing_m;
        let start = Vector2::new(origin.x - self.origin_m.x, origin.y - self.origin_m.y) * scale;
        let step = Vector2::new(direction.x, direction.y) * scale;
        let mut at_m = from_m;
        let mut above = None;
        let square = |t: f64| {
            let p = start + step * t;
            (p.x.floor(), p.y.floor())
        };
        let (mut column, mut row) = square(from_m);
        loop {
            let leave_x = leave(start.x, step.x, column);
            let leave_y = leave(start.y, step.y, row);
            let leave_m = leave_x.min(leave_y).min(to_m).max(at_m);
            let (ray, span_m) = ((start, step), [at_m, leave_m]);
            let hit =
                self.cast_in_square(origin, direction, ray, [column, row], span_m, &mut above);
            if hit.is_some() {
                return hit;
            }
            if leave_m >= to_m {
                return None;
            }
            if leave_x <= leave_y {
                column += step.x.signum();
            } else {
                row += step.y.signum();
            }
            at_m = leave_m;
        }
    }

    /// Cuts the ray at the square's diagonal; on each part its height above the triangle is linear.
    fn cast_in_square(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        (start, step): (Vector2<f64>, Vector2<f64>),
        [column, row]: [f64; 2],
        [from_m, to_m]: [f64; 2],
        above: &mut Option<(f64, f64)>,
    ) -> Option<f64> {
        if column < 0.0 || row < 0.0 || column >= self.columns as f64 || row >= self.rows as f64 {
            *above = None;
            return None;
        }
        let (column_index, row_index) = (column as usize, row as usize);
        let clearance = |t: f64| {
            let p = start + step * t;
            let ground = self.height_in_square(column_index, row_index, p.x - column, p.y - row);
            origin.z + direction.z * t - ground
        };
        let slant = step.x - step.y;
        let diagonal_m = ((start.y - row) - (start.x - column)) / slant;
        let middle = (diagonal_m > from_m && diagonal_m < to_m).then_some(diagonal_m);
        for t in [Some(from_m), middle, Some(to_m)].into_iter().flatten() {
            let now = clearance(t);
            if let Some((before_m, before)) = *above
                && before > 0.0
                && now <= 0.0
            {
                return Some(before_m + (t - before_m) * before / (before - now));
            }
            *above = Some((t, now));
        }
        None
    }

    fn height_in_square(&self, column: usize, row: usize, u: f64, v: f64) -> f64 {
        let [low, right, left, high] = self.corners(column, row);
        if u >= v {
            low + (right - low) * u + (high - right) * v
        } else {
            low + (high - left) * u + (left - low) * v
        }
    }

    /// Heights at (0,0), (1,0), (0,1), (1,1) of a square.
    fn corners(&self, column: usize, row: usize) -> [f64; 4] {
        [
            self.corner(column, row),
            self.corner(column + 1, row),
            self.corner(column, row + 1),
            self.corner(column + 1, row + 1),
        ]
    }

    fn corner(&self, column: usize, row: usize) -> f64 {
        let height = self.heights_m.get(row * (self.columns + 1) + column);
        height.copied().unwrap_or(f64::NEG_INFINITY)
    }
}

/// Ray parameter at which a coordinate `start + step t` leaves the unit interval that begins at `cell`.
pub(super) fn leave(start: f64, step: f64, cell: f64) -> f64 {
    if step > 0.0 {
        (cell + 1.0 - start) / step
    } else if step < 0.0 {
        (cell - start) / step
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hills() -> HeightField {
        HeightField::from_fn(Vector2::new(-5.0, -4.0), 0.5, [24, 18], |_, _, p| {
            (0.9 * p.x).sin() * (0.7 * p.y).cos()
        })
    }

    /// First crossing found by small steps and bisection.
    fn march(
        field: &HeightField,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        to_m: f64,
    ) -> Option<f64> {
        let clearance = |t: f64| {
            let p = origin + direction * t;
            field.height_m(p.x, p.y).map(|h| p.z - h)
        };
        let step = 0.001;
        let mut t = 0.0;
        while t < to_m {
            if let (Some(a), Some(b)) = (clearance(t), clearance(t + step))
                && a > 0.0
                && b <= 0.0
            {
                return Some(t + step * a / (a - b));
            }
            t += step;
        }
        None
    }

    proptest! {
        #[test]
        fn equals_a_march_in_small_steps(
            x in -4.5f64..6.5, y in -3.5f64..4.5, z in 1.2f64..4.0, azimuth in 0.0f64..6.3, elevation in -1.5f64..0.2
        ) {
            let field = hills();
            let origin = Vector3::new(x, y, z);
            let direction = Vector3::new(
                elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
            match (field.cast(&origin, &direction, 0.0, 20.0), march(&field, &origin, &direction, 20.0)) {
                (Some(hit), Some(expected)) => {
                    let p = origin + direction * hit;
                    let ground = field.height_m(p.x, p.y).unwrap();
                    prop_assert!((p.z - ground).abs() < 1e-9, "off the surface by {}", p.z - ground);
                    // Between two marched samples the ray may graze a crest that the march steps over.
                    prop_assert!(hit <= expected + 0.002, "{hit} against {expected}");
                    prop_assert!((hit - expected).abs() < 0.002 || hit < expected);
                }
                (None, Some(expected)) => prop_assert!(false, "missed the hit at {expected}"),
                (Some(hit), None) => {
                    let p = origin + direction * hit;
                    prop_assert!((p.z - field.height_m(p.x, p.y).unwrap()).abs() < 1e-9);
                }
                (None, None) => {}
            }
        }
    }

    #[test]
    fn a_vertical_ray_falls_on_the_surface_below() {
        let field = hills();
        let above = Vector3::new(1.3, 0.4, 3.0);
        let hit = field.cast(&above, &-Vector3::z(), 0.0, 10.0).unwrap();
        assert!((3.0 - hit - field.height_m(1.3, 0.4).unwrap()).abs() < 1e-12);
    }

    #[test]
    fn the_normal_is_that_of_the_slope() {
        let field = HeightField::from_fn(Vector2::zeros(), 0.25, [8, 8], |_, _, p| {
            0.5 * p.x - 0.25 * p.y
        });
        for (x, y) in [(0.3, 0.31), (1.9, 0.2), (0.2, 1.7)] {
            let normal = field.normal(x, y).unwrap();
            assert!((normal - Vector3::new(-0.5, 0.25, 1.0).normalize()).norm() < 1e-12);
        }
        assert!(field.normal(-0.1, 0.0).is_none());
    }
}
