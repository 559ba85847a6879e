//! Furniture of each room, as `rooms.txt` lists it.

use super::builder::{Builder, Spot};
use super::classes::{COUNTER, OTHER};
use super::furniture::*;
use super::listing::lines;
use crate::AnyError;
use crate::simulate::random::Stream;

/// Distance from the middle of a wall to furniture against it, m.
const GAP: f32 = 0.08;

pub(super) fn furnish(b: &mut Builder, s: &mut Stream) -> Result<(), AnyError> {
    for line in lines(include_str!("rooms.txt")) {
        let (line, words, n) = line?;
        let placed = match words.as_slice() {
            [piece, place] => spot(place, &n, s).and_then(|(spot, n)| add(b, s, piece, spot, n)),
            _ => None,
        };
        placed.ok_or_else(|| format!("rooms.txt: {line}"))?;
    }
    Ok(())
}

/// The spot that a place and its numbers say, and the other numbers.
fn spot<'a>(place: &str, n: &'a [f32], s: &mut Stream) -> Option<(Spot, &'a [f32])> {
    let (along, rest) = n.split_first().unzip();
    let (wall, rest) = rest.unwrap_or_default().split_first().unzip();
    let (along, wall) = (*along.unwrap_or(&0.0), *wall.unwrap_or(&0.0));
    let rest = rest.unwrap_or_default();
    let at = |x, y, yaw_deg| Spot { x, y, yaw_deg };
    Some(match (place, rest) {
        ("part", _) => (at(0.0, 0.0, 0.0), n),
        ("south", _) => (at(along, wall + GAP, 0.0), rest),
        ("north", _) => (at(along, wall - GAP, 180.0), rest),
        ("west", _) => (at(wall + GAP, along, -90.0), rest),
        ("east", _) => (at(wall - GAP, along, 90.0), rest),
        ("at", [yaw, rest @ ..]) => (at(along, wall, *yaw), rest),
        ("left", [yaw, rest @ ..]) => {
            // Moved and turned a little, as people leave chairs.
            let mut off = |most: f32| s.between(-most, most);
            (
                at(along + off(0.07), wall + off(0.07), yaw + off(18.0)),
                rest,
            )
        }
        ("anyhow", _) => (at(along, wall, s.between(0.0, 90.0)), rest),
        _ => return None,
    })
}

/// Adds a piece, or a part of the last thing.
fn add(b: &mut Builder, s: &mut Stream, piece: &str, spot: Spot, n: &[f32]) -> Option<()> {
    match (piece, n) {
        ("block", &[x, y, z, to_x, to_y, to_z]) => drop(b.block([x, y, z], [to_x, to_y, to_z])),
        ("drum", &[x, y, z, to_z, low, high]) => drop(b.drum([x, y], [z, to_z], [low, high])),
        ("other", []) => drop(b.thing(OTHER, spot)),
        ("counter", []) => drop(b.thing(COUNTER, spot)),
        ("counter", &[width]) => counter(b, spot, width),
        ("cabinet", &[w, d, h, doors]) => cabinet(b, spot, [w, d, h], doors as i32),
        ("tv", &[width, z]) => tv(b, spot, width, z),
        ("sofa", &[width]) => sofa(b, spot, width),
        ("table", &[w, d, h]) => table(b, spot, [w, d, h]),
        ("desk", &[w, d, h]) => desk(b, spot, [w, d, h], s),
        ("bookshelf", &[width, height]) => bookshelf(b, spot, [width, height], s),
        ("lamp", &[height]) => lamp(b, spot, height),
        ("picture", &[width, height, z]) => picture(b, spot, [width, height], z),
        ("bed", &[width]) => bed(b, spot, width),
        ("chair", []) => chair(b, spot),
        ("office_chair", []) => office_chair(b, spot),
        ("fridge", []) => fridge(b, spot),
        ("plant", []) => plant(b, spot, s),
        ("clutter", []) => clutter(b, spot, s),
        _ => return None,
    }
    Some(())
}
