//! Floor, walls, doors and windows.

use super::builder::{Builder, Spot};
use super::{CEILING, CURTAIN, DOOR, FLOOR, WALL, WINDOW};

/// Height of the rooms, m.
const HEIGHT: f32 = 2.8;
/// Half the thickness of a wall, m.
const HALF: f32 = 0.06;

/// An opening in a wall: from and to along it, lower and upper height, m.
#[derive(Clone, Copy)]
enum Opening {
    /// Open, with a door leaf turned by so many degrees, if any.
    Door(f32, f32, Option<f32>),
    /// With a pane, from the height of the sill to that of the lintel.
    Window(f32, f32, f32, f32),
}

use Opening::{Door, Window};

/// Walls along x: their y, from and to, openings in order.
const ALONG_X: [(f32, f32, f32, &[Opening]); 5] = [
    (
        0.0,
        0.0,
        20.0,
        &[
            Window(1.0, 2.6, 0.9, 2.2),
            Window(9.4, 12.4, 1.1, 2.1),
            Window(16.4, 18.2, 0.8, 2.3),
        ],
    ),
    (
        6.5,
        0.0,
        20.0,
        &[
            Door(5.8, 7.4, None),
            Door(9.0, 10.0, Some(75.0)),
            Door(15.2, 16.1, Some(60.0)),
        ],
    ),
    (
        7.9,
        0.0,
        20.0,
        &[
            Door(4.2, 5.1, Some(-80.0)),
            Door(7.4, 8.2, Some(-50.0)),
            Door(11.6, 12.6, None),
            Door(17.8, 18.7, Some(-70.0)),
        ],
    ),
    (
        12.0,
        0.0,
        15.6,
        &[
            Window(1.2, 3.0, 0.9, 2.2),
            Window(7.6, 8.3, 1.5, 2.2),
            Window(10.6, 13.8, 0.5, 2.2),
        ],
    ),
    // The store in the corner is set back.
    (11.0, 15.6, 20.0, &[Window(17.0, 18.0, 1.4, 2.1)]),
];

/// Walls along y: their x, from and to, openings in order.
const ALONG_Y: [(f32, f32, f32, &[Opening]); 8] = [
    (
        0.0,
        0.0,
        12.0,
        &[Window(3.2, 5.6, 0.4, 2.3), Window(9.0, 10.2, 0.9, 2.2)],
    ),
    (
        20.0,
        0.0,
        11.0,
        &[Window(1.6, 3.9, 0.9, 2.2), Window(6.9, 7.5, 0.2, 2.2)],
    ),
    (8.0, 0.0, 6.5, &[Door(2.2, 4.4, None)]),
    (14.2, 0.0, 6.5, &[Door(5.3, 6.2, None)]),
    (6.3, 7.9, 12.0, &[]),
    (9.4, 7.9, 12.0, &[]),
    (15.6, 7.9, 12.0, &[]),
    // A stub that makes the kitchen a corner of its own.
    (11.0, 5.0, 6.5, &[]),
];

pub(super) fn build(builder: &mut Builder) {
    builder
        .fixed(FLOOR)
        .block([0.0, 0.0, -0.1], [20.0, 12.0, 0.0]);
    builder
        .fixed(CEILING)
        .block([0.0, 0.0, HEIGHT], [20.0, 12.0, HEIGHT + 0.1]);
    for (y, from, to, openings) in ALONG_X {
        wall(
            builder,
            Spot {
                x: from,
                y,
                yaw_deg: 0.0,
            },
            from,
            to,
            openings,
        );
    }
    for (x, from, to, openings) in ALONG_Y {
        wall(
            builder,
            Spot {
                x,
                y: from,
                yaw_deg: 90.0,
            },
            from,
            to,
            openings,
        );
    }
    // A chimney and a column.
    builder
        .fixed(WALL)
        .block([7.3, 5.7, 0.0], [8.0, 6.5, HEIGHT]);
    builder
        .fixed(WALL)
        .drum([13.4, 9.6], [0.0, HEIGHT], [0.16, 0.16]);
    curtain(
        builder,
        Spot {
            x: 0.18,
            y: 3.0,
            yaw_deg: 90.0,
        },
        1.1,
    );
    curtain(
        builder,
        Spot {
            x: 0.18,
            y: 5.0,
            yaw_deg: 90.0,
        },
        0.8,
    );
    curtain(
        builder,
        Spot {
            x: 10.3,
            y: 11.82,
            yaw_deg: 0.0,
        },
        0.9,
    );
}

/// A wall along the x axis of its spot, which stands at `from`.
fn wall(builder: &mut Builder, spot: Spot, from: f32, to: f32, openings: &[Opening]) {
    let piece = |builder: &mut Builder, a: f32, b: f32, low: f32, high: f32| {
        if b > a && high > low {
            builder.block([a - from, -HALF, low], [b - from, HALF, high]);
        }
    };
    builder.thing(WALL, spot);
    let mut at = from;
    for opening in openings {
        let (a, b, sill, lintel) = match *opening {
            Door(a, b, _) => (a, b, 0.0, 2.1),
            Window(a, b, sill, lintel) => (a, b, sill, lintel),
        };
        piece(builder, at, a, 0.0, HEIGHT);
        piece(builder, a, b, 0.0, sill);
        piece(builder, a, b, lintel, HEIGHT);
        at = b;
    }
    piece(builder, at, to, 0.0, HEIGHT);
    let (sin, cos) = spot.yaw_deg.to_radians().sin_cos();
    for opening in openings {
        match *opening {
            Window(a, b, sill, lintel) => {
                let middle = (a + b) / 2.0 - from;
                let window = builder.thing(WINDOW, spot);
                window.block([a - from, -0.01, sill], [b - from, 0.01, lintel]);
                window.block([middle - 0.03, -0.03, sill], [middle + 0.03, 0.03, lintel]);
                window.block(
                    [a - from - 0.05, -0.14, sill - 0.04],
                    [b - from + 0.05, 0.14, sill],
                );
            }
            Door(a, b, Some(open_deg)) => {
                let hinge = Spot {
                    x: spot.x + cos * (a - from),
                    y: spot.y + sin * (a - from),
                    yaw_deg: spot.yaw_deg + open_deg,
                };
                let leaf = builder.thing(DOOR, hinge);
                leaf.block([0.02, -0.02, 0.01], [b - a - 0.02, 0.02, 2.05]);
                leaf.block([b - a - 0.14, -0.07, 1.0], [b - a - 0.08, 0.07, 1.04]);
            }
            Door(_, _, None) => {}
        }
    }
}

/// Folds of cloth from the floor to above a window.
fn curtain(builder: &mut Builder, spot: Spot, width: f32) {
    let curtain = builder.thing(CURTAIN, spot);
    let folds = (width / 0.09) as i32;
    for fold in 0..folds {
        let x = fold as f32 * 0.09;
        let y = if fold % 2 == 0 { 0.0 } else { 0.05 };
        curtain.block([x, y - 0.02, 0.03], [x + 0.09, y + 0.02, 2.45]);
    }
}
