//! The shape of the ground: smooth, so that the loader's pose is smooth in time.

use nalgebra::Vector2;

/// Long waves: amplitude (m), wave vector (rad/m), phase (rad).
const WAVES: [(f64, f64, f64, f64); 5] = [
    (0.45, 0.041, 0.023, 0.4),
    (0.30, -0.032, 0.067, 1.9),
    (0.12, 0.121, -0.084, 2.6),
    (0.06, 0.213, 0.190, 5.1),
    (0.03, -0.430, 0.370, 3.3),
];

/// Bell-shaped heaps: middle (m), height (m), spread along x and y (m).
const HEAPS: [(f64, f64, f64, f64, f64); 4] = [
    (8.0, 2.0, 4.0, 5.0, 6.2),
    (24.0, -24.0, 1.6, 4.0, 3.2),
    (-8.0, -30.0, 1.1, 3.0, 3.6),
    (45.0, 8.0, 2.1, 4.2, 4.8),
];

/// The pit: middle, half extents to the middle of the walls, depth (m).
const PIT_M: ([f64; 2], [f64; 2], f64) = ([-26.0, 20.0], [9.0, 8.0], 2.2);
/// Widths of the pit's walls, west, east (the ramp), south, north (m).
const PIT_WALLS_M: [f64; 4] = [3.0, 12.0, 3.0, 4.0];

/// Ridges of the berm: from, to, height, spread (m).
const RIDGES: [([f64; 2], [f64; 2], f64, f64); 3] = [
    ([-56.0, -62.0], [-54.0, 30.0], 1.5, 1.7),
    ([-54.0, 30.0], [-38.0, 58.0], 1.3, 1.7),
    ([-30.0, -70.0], [30.0, -72.0], 1.0, 1.4),
];

/// Height of the smooth ground at map coordinates (m), twice differentiable where the loader drives.
pub fn ground_height_m(x_m: f64, y_m: f64) -> f64 {
    let wave = |&(a, kx, ky, phase): &(f64, f64, f64, f64)| a * (kx * x_m + ky * y_m + phase).sin();
    let waves: f64 = WAVES.iter().map(wave).sum();
    let heap = |&(cx, cy, height, sx, sy): &(f64, f64, f64, f64, f64)| {
        let (u, v) = ((x_m - cx) / sx, (y_m - cy) / sy);
        height * bell(u * u + v * v)
    };
    let heaps: f64 = HEAPS.iter().map(heap).sum();
    let ridge = |&(from, to, height, spread): &([f64; 2], [f64; 2], f64, f64)| {
        height * bell(squared_distance_to_segment(x_m, y_m, from, to) / (spread * spread))
    };
    let ridges: f64 = RIDGES.iter().map(ridge).sum();
    waves + heaps + ridges - pit_depth_m(x_m, y_m)
}

fn bell(squared: f64) -> f64 {
    if squared > 40.0 {
        0.0
    } else {
        (-squared).exp()
    }
}

fn pit_depth_m(x_m: f64, y_m: f64) -> f64 {
    let ([cx, cy], [half_x, half_y], depth) = PIT_M;
    let [west, east, south, north] = PIT_WALLS_M;
    let wall = |inside: f64, width: f64| smoothstep(0.5 + inside / width);
    let (dx, dy) = (x_m - cx, y_m - cy);
    depth
        * wall(half_x + dx, west)
        * wall(half_x - dx, east)
        * wall(half_y + dy, south)
        * wall(half_y - dy, north)
}

/// Quintic step from 0 to 1 over 0..1, with two derivatives zero at its ends.
fn smoothstep(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 - u * (15.0 - 6.0 * u))
}

fn squared_distance_to_segment(x: f64, y: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    let (point, from, to) = (Vector2::new(x, y), Vector2::from(from), Vector2::from(to));
    let along = to - from;
    let u = ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (point - from - along * u).norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pile_is_about_four_metres_and_the_pit_two_deep() {
        let around: f64 = (0..36)
            .map(|i| f64::from(i).to_radians() * 10.0)
            .map(|a| ground_height_m(8.0 + 14.0 * a.cos(), 2.0 + 14.0 * a.sin()))
            .sum::<f64>()
            / 36.0;
        let pile = ground_height_m(8.0, 2.0) - around;
        assert!((3.5..4.8).contains(&pile), "pile {pile}");
        let pit = ground_height_m(-26.0, 36.0) - ground_height_m(-26.0, 20.0);
        assert!((1.5..3.0).contains(&pit), "pit {pit}");
    }

    #[test]
    fn heights_have_no_steps() {
        let h = 0.01;
        for i in -6900..6900 {
            let x = f64::from(i) * h;
            for y in [-70.5, -61.0, 20.0, 1.3] {
                let step = (ground_height_m(x + h, y) - ground_height_m(x, y)).abs();
                assert!(step < 1.6 * h, "slope {} at {x}, {y}", step / h);
            }
        }
    }
}
