//! Floor, walls, doors and windows.

use super::builder::{Builder, Spot};
use super::classes::{CEILING, CURTAIN, DOOR, FLOOR, WALL, WINDOW};
use super::listing::lines;
use crate::AnyError;

/// Height of the rooms, m.
const HEIGHT: f32 = 2.8;
/// Half the thickness of a wall, m.
const HALF: f32 = 0.06;

/// An opening in a wall: from and to along it, lower and upper height, m.
#[derive(Clone, Copy)]
pub(super) enum Opening {
    /// Open, with a door leaf turned by so many degrees, if any.
    Door(f32, f32, Option<f32>),
    /// With a pane, from the height of the sill to that of the lintel.
    Window(f32, f32, f32, f32),
}

use Opening::{Door, Window};

/// A wall: its spot, from and to, openings in order.
type Wall = (Spot, f32, f32, Vec<Opening>);

/// The walls that `walls.txt` lists.
fn walls() -> Result<Vec<Wall>, AnyError> {
    let mut walls: Vec<Wall> = Vec::new();
    let spot = |x, y, yaw_deg| Spot { x, y, yaw_deg };
    for line in lines(include_str!("walls.txt")) {
        let (line, words, n) = line?;
        let opening = match (words.as_slice(), n.as_slice()) {
            (["window"], &[from, to, sill, lintel]) => Window(from, to, sill, lintel),
            (["door"], &[from, to]) => Door(from, to, None),
            (["door"], &[from, to, open_deg]) => Door(from, to, Some(open_deg)),
            (["along_x"], &[y, from, to]) => {
                walls.push((spot(from, y, 0.0), from, to, Vec::new()));
                continue;
            }
            (["along_y"], &[x, from, to]) => {
                walls.push((spot(x, from, 90.0), from, to, Vec::new()));
                continue;
            }
            _ => return Err(format!("walls.txt: {line}").into()),
        };
        let wall = walls.last_mut().ok_or("walls.txt begins with an opening")?;
        wall.3.push(opening);
    }
    Ok(walls)
}

pub(super) fn build(builder: &mut Builder) -> Result<(), AnyError> {
    let floor = builder.fixed(FLOOR);
    floor.block([0.0, 0.0, -0.1], [20.0, 12.0, 0.0]);
    let ceiling = builder.fixed(CEILING);
    ceiling.block([0.0, 0.0, HEIGHT], [20.0, 12.0, HEIGHT + 0.1]);
    for (spot, from, to, openings) in walls()? {
        wall(builder, spot, from, to, &openings, HEIGHT);
    }
    // A chimney and a column.
    let chimney = builder.fixed(WALL);
    chimney.block([7.3, 5.7, 0.0], [8.0, 6.5, HEIGHT]);
    let column = builder.fixed(WALL);
    column.drum([13.4, 9.6], [0.0, HEIGHT], [0.16, 0.16]);
    for (x, y, yaw_deg, width) in [
        (0.18, 3.0, 90.0, 1.1),
        (0.18, 5.0, 90.0, 0.8),
        (10.3, 11.82, 0.0, 0.9),
    ] {
        curtain(builder, Spot { x, y, yaw_deg }, width);
    }
    Ok(())
}

/// A wall along the x axis of its spot, which stands at `from`, of a height.
pub(super) fn wall(
    builder: &mut Builder,
    spot: Spot,
    from: f32,
    to: f32,
    openings: &[Opening],
    height: f32,
) {
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
        piece(builder, at, a, 0.0, height);
        piece(builder, a, b, 0.0, sill);
        piece(builder, a, b, lintel, height);
        at = b;
    }
    piece(builder, at, to, 0.0, height);
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
pub(super) fn curtain(builder: &mut Builder, spot: Spot, width: f32) {
    let curtain = builder.thing(CURTAIN, spot);
    let folds = (width / 0.09) as i32;
    for fold in 0..folds {
        let x = fold as f32 * 0.09;
        let y = if fold % 2 == 0 { 0.0 } else { 0.05 };
        curtain.block([x, y - 0.02, 0.03], [x + 0.09, y + 0.02, 2.45]);
    }
}
