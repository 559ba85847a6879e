//! Obstacles of the earth-moving site.

use super::ground::ground_height_m;
use super::obstacles::{Block, Obstacle, Post};
use nalgebra::{Vector2, Vector3};

/// All obstacles of the site.
pub(super) fn earth_moving_obstacles() -> Vec<Obstacle> {
    let mut obstacles = Vec::new();
    // Building and lean-to, containers (two stacked), barriers, a water tank, pallets: x, y, yaw (deg), length, width,
    // height, height of the foot above ground, reflectivity.
    let blocks = [
        (40.0, 46.0, 12.0, 24.0, 14.0, 7.0, 0.0, 0.5),
        (24.8, 42.8, 12.0, 6.0, 9.0, 3.4, 0.0, 0.4),
        (-20.0, -8.0, 35.0, 6.06, 2.44, 2.59, 0.0, 0.35),
        (-14.5, -4.2, 35.0, 6.06, 2.44, 2.59, 0.0, 0.25),
        (-14.5, -4.2, 35.0, 6.06, 2.44, 2.59, 2.59, 0.45),
        (20.0, 20.0, -70.0, 12.19, 2.44, 2.59, 0.0, 0.35),
        (50.0, -40.0, 90.0, 6.06, 2.44, 2.59, 0.0, 0.3),
        (46.5, -40.0, 90.0, 6.06, 2.44, 2.59, 0.0, 0.4),
        (-4.0, 30.0, 80.0, 3.0, 0.6, 0.9, 0.0, 0.55),
        (-3.4, 33.4, 80.0, 3.0, 0.6, 0.9, 0.0, 0.55),
        (-2.8, 36.8, 80.0, 3.0, 0.6, 0.9, 0.0, 0.55),
        (2.0, -12.0, 20.0, 2.4, 1.8, 1.9, 0.0, 0.3),
        (-35.0, -32.0, 0.0, 1.2, 1.0, 1.1, 0.0, 0.3),
        (-33.0, -33.5, 25.0, 1.2, 1.0, 0.6, 0.0, 0.3),
        (14.0, -52.0, -15.0, 7.5, 2.5, 3.1, 0.0, 0.35),
    ];
    for (x, y, yaw_deg, length, width, height, foot, reflectivity) in blocks {
        let yaw = f64::to_radians(yaw_deg);
        let size = [length, width, height];
        obstacles.push(standing(x, y, yaw, size, foot, reflectivity));
    }
    fence(&mut obstacles);
    for (x, y) in LAMPS_M {
        obstacles.push(post(x, y, 0.11, 6.5, 0.4));
    }
    for (x, y) in STAKES_M {
        obstacles.push(post(x, y, 0.03, 1.5, 0.6));
    }
    obstacles
}

/// A hoarding of 10 m panels around the site, two of them open as a gate, and a post at every joint.
fn fence(obstacles: &mut Vec<Obstacle>) {
    let (east, north) = (66.0_f64, 80.0_f64);
    let [south, north] = [-north, north].map(|y| [(-east, y), (east, y)]);
    let corners = [south[0], south[1], north[1], north[0]];
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    for (side, (&(x0, y0), &(x1, y1))) in sides.enumerate() {
        let (from, along) = (Vector2::new(x0, y0), Vector2::new(x1 - x0, y1 - y0));
        let panels = (along.norm() / 10.0).round();
        let yaw = along.y.atan2(along.x);
        for i in 0..panels as usize {
            let joint = from + along * (i as f64 / panels);
            obstacles.push(post(joint.x, joint.y, 0.05, 2.3, 0.4));
            let middle = from + along * ((i as f64 + 0.5) / panels);
            let gate = side == 0 && (i == 6 || i == 7);
            if !gate {
                let size = [along.norm() / panels - 0.12, 0.04, 2.0];
                obstacles.push(standing(middle.x, middle.y, yaw, size, 0.0, 0.45));
            }
        }
    }
}

/// A box that reaches half a metre into the ground at its middle, `foot_m` lifting it.
fn standing(
    x: f64,
    y: f64,
    yaw_rad: f64,
    [length, width, height]: [f64; 3],
    foot_m: f64,
    reflectivity: f64,
) -> Obstacle {
    let bury_m = if foot_m > 0.0 { 0.0 } else { 0.8 };
    let foot = ground_height_m(x, y) + foot_m - bury_m;
    let tall = height + bury_m;
    let center = Vector3::new(x, y, foot + 0.5 * tall);
    let size = Vector3::new(length, width, tall);
    Obstacle::Block(Block::new(center, size, yaw_rad), reflectivity)
}

fn post(x: f64, y: f64, radius_m: f64, height_m: f64, reflectivity: f64) -> Obstacle {
    let ground = ground_height_m(x, y);
    let post = Post {
        center_m: Vector2::new(x, y),
        radius_m,
        span_m: [ground - 0.5, ground + height_m],
    };
    Obstacle::Post(post, reflectivity)
}

/// Lamp posts and survey stakes.
const LAMPS_M: [(f64, f64); 7] = [
    (-62.0, -20.0),
    (-62.0, 40.0),
    (0.0, 76.0),
    (60.0, 20.0),
    (60.0, -30.0),
    (0.0, -60.0),
    (-2.5, 20.0),
];
const STAKES_M: [(f64, f64); 8] = [
    (-37.5, 9.0),
    (-37.5, 31.0),
    (-11.5, 31.5),
    (0.5, -4.5),
    (15.5, -4.0),
    (18.0, 9.5),
    (-31.0, 33.0),
    (3.0, 14.0),
];
