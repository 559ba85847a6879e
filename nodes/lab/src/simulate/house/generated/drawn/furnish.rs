//! Furniture of drawn rooms: pieces along walls and in the middle that do not stand in each other.

use super::super::builder::{Builder, Spot};
use super::super::classes::{OTHER, TABLE};
use super::super::furniture::*;
use crate::simulate::random::Stream;

/// Distance from the middle of a wall to furniture against it, metres.
const GAP: f32 = 0.08;
/// Places tried for a piece.
const TRIES: usize = 14;

/// Area on the floor: from and to along x and along y, metres.
type Area = [f32; 4];

/// A room, with what stands in it.
pub(super) struct Room {
    area: Area,
    taken: Vec<Area>,
}

/// Pieces of a kind of room: name, and how likely it is there, in percent.
type Pieces = &'static [(&'static str, u32)];

const LIVING: Pieces = &[
    ("tv", 95),
    ("sofa", 90),
    ("low table", 80),
    ("sofa", 40),
    ("bookshelf", 60),
    ("cabinet", 50),
    ("lamp", 50),
    ("plant", 50),
    ("picture", 70),
    ("picture", 50),
    ("picture", 40),
    ("clutter", 40),
];
const DINING: Pieces = &[
    ("dining", 100),
    ("cabinet", 60),
    ("counter", 50),
    ("fridge", 40),
    ("picture", 60),
    ("picture", 40),
    ("plant", 40),
    ("lamp", 20),
    ("bookshelf", 25),
    ("clutter", 30),
];
const STUDY: Pieces = &[
    ("desk", 100),
    ("bookshelf", 85),
    ("bookshelf", 50),
    ("desk", 30),
    ("cabinet", 50),
    ("picture", 50),
    ("lamp", 40),
    ("clutter", 60),
    ("sofa", 30),
    ("plant", 30),
    ("picture", 30),
];
const BEDROOM: Pieces = &[
    ("bed", 100),
    ("night table", 70),
    ("night table", 40),
    ("wardrobe", 80),
    ("tv", 40),
    ("desk", 35),
    ("picture", 60),
    ("chair", 40),
    ("lamp", 30),
    ("clutter", 40),
    ("bookshelf", 25),
];
const KITCHEN: Pieces = &[
    ("counter", 100),
    ("counter", 60),
    ("fridge", 90),
    ("dining", 70),
    ("cabinet", 40),
    ("wardrobe", 20),
    ("clutter", 40),
    ("picture", 40),
    ("plant", 20),
];
const LIBRARY: Pieces = &[
    ("bookshelf", 100),
    ("bookshelf", 80),
    ("bookshelf", 60),
    ("low table", 50),
    ("sofa", 50),
    ("chair", 60),
    ("desk", 40),
    ("picture", 50),
    ("lamp", 40),
    ("plant", 40),
    ("tv", 20),
];

impl Room {
    pub(super) fn new(area: Area, doorways: Vec<Area>) -> Room {
        Room {
            area,
            taken: doorways,
        }
    }

    /// Takes an area if nothing is in it.
    fn take(&mut self, area: Area) -> bool {
        let [x, to_x, y, to_y] = area;
        let [low_x, high_x, low_y, high_y] = self.area;
        let is_inside =
            x > low_x + 0.05 && to_x < high_x - 0.05 && y > low_y + 0.05 && to_y < high_y - 0.05;
        let meets = |a: &Area| x < a[1] && a[0] < to_x && y < a[3] && a[2] < to_y;
        let is_free = is_inside && !self.taken.iter().any(meets);
        if is_free {
            self.taken.push(area);
        }
        is_free
    }

    /// A spot against a wall, with room for a size and something before it.
    fn at_wall(&mut self, s: &mut Stream, wide: f32, deep: f32, before: f32) -> Option<Spot> {
        let [low_x, high_x, low_y, high_y] = self.area;
        for _ in 0..TRIES {
            let (side, share) = ((s.uniform() * 4.0) as usize, s.uniform() as f32);
            let along = |low: f32, high: f32| {
                let half = wide / 2.0 + 0.1;
                low + half + share * (high - low - 2.0 * half).max(0.0)
            };
            let (spot, area) = match side {
                0 => {
                    let x = along(low_x, high_x);
                    let y = low_y + GAP;
                    (
                        at(x, y, 0.0),
                        [x - wide / 2.0, x + wide / 2.0, y, y + deep + before],
                    )
                }
                1 => {
                    let x = along(low_x, high_x);
                    let y = high_y - GAP;
                    (
                        at(x, y, 180.0),
                        [x - wide / 2.0, x + wide / 2.0, y - deep - before, y],
                    )
                }
                2 => {
                    let y = along(low_y, high_y);
                    let x = low_x + GAP;
                    (
                        at(x, y, -90.0),
                        [x, x + deep + before, y - wide / 2.0, y + wide / 2.0],
                    )
                }
                _ => {
                    let y = along(low_y, high_y);
                    let x = high_x - GAP;
                    (
                        at(x, y, 90.0),
                        [x - deep - before, x, y - wide / 2.0, y + wide / 2.0],
                    )
                }
            };
            if self.take(area) {
                return Some(spot);
            }
        }
        None
    }

    /// The middle of a free square on the floor.
    fn amid(&mut self, s: &mut Stream, side: f32) -> Option<[f32; 2]> {
        let [low_x, high_x, low_y, high_y] = self.area;
        for _ in 0..TRIES {
            let (x, y) = (s.between(low_x, high_x), s.between(low_y, high_y));
            let half = side / 2.0;
            if self.take([x - half, x + half, y - half, y + half]) {
                return Some([x, y]);
            }
        }
        None
    }
}

fn at(x: f32, y: f32, yaw_deg: f32) -> Spot {
    Spot { x, y, yaw_deg }
}

/// Furnishes a room as one of some kinds.
pub(super) fn room(b: &mut Builder, s: &mut Stream, mut room: Room, number: usize) {
    const KINDS: [Pieces; 6] = [LIVING, DINING, STUDY, BEDROOM, KITCHEN, LIBRARY];
    // The first three are in every house, so that most have all scenes.
    let kind = match number {
        0 => LIVING,
        1 => DINING,
        2 => STUDY,
        _ => KINDS[(s.uniform() * KINDS.len() as f64) as usize % KINDS.len()],
    };
    for (piece, percent) in kind {
        if s.uniform() * 100.0 < f64::from(*percent) {
            // Without a place it is left out.
            let _ = add(b, s, &mut room, piece);
        }
    }
}

/// Width, depth and height, each drawn between two, metres.
fn size(s: &mut Stream, ranges_m: [[f32; 2]; 3]) -> [f32; 3] {
    ranges_m.map(|[low_m, high_m]| s.between(low_m, high_m))
}

fn add(b: &mut Builder, s: &mut Stream, room: &mut Room, piece: &str) -> Option<()> {
    match piece {
        "tv" => stand_with_tv(b, s, room)?,
        "dining" => dining(b, s, room)?,
        "sofa" => {
            let wide = s.between(1.0, 2.4);
            let spot = room.at_wall(s, wide, 0.9, 0.4)?;
            sofa(b, spot, wide);
        }
        "low table" => {
            let [x, y] = room.amid(s, 1.1)?;
            let size = size(s, [[0.6, 1.1], [0.5, 0.7], [0.35, 0.5]]);
            any_table(b, s, at(x, y - size[1] / 2.0, 0.0), size);
        }
        "bookshelf" => {
            let size = [s.between(0.7, 2.0), s.between(1.0, 2.3)];
            let spot = room.at_wall(s, size[0], 0.3, 0.5)?;
            bookshelf(b, spot, size, s);
        }
        "cabinet" => {
            let size = size(s, [[0.6, 2.0], [0.3, 0.55], [0.5, 1.4]]);
            let doors = (s.uniform() * 4.0) as i32 + 1;
            let spot = room.at_wall(s, size[0], size[1], 0.4)?;
            cabinet(b, spot, size, doors);
        }
        "wardrobe" => {
            let size = size(s, [[0.9, 2.2], [0.5, 0.65], [1.7, 2.2]]);
            let doors = (s.uniform() * 3.0) as i32 + 2;
            let spot = room.at_wall(s, size[0], size[1], 0.4)?;
            cabinet(b, spot, size, doors);
        }
        "night table" => {
            let size = [0.45, 0.4, s.between(0.4, 0.6)];
            let spot = room.at_wall(s, size[0], size[1], 0.1)?;
            cabinet(b, spot, size, 1);
        }
        "desk" => study_desk(b, s, room)?,
        "bed" => {
            let wide = s.between(0.9, 2.0);
            let spot = room.at_wall(s, wide, 2.1, 0.3)?;
            bed(b, spot, wide);
        }
        "counter" => {
            let wide = s.between(1.2, 2.6);
            let spot = room.at_wall(s, wide, 0.65, 0.5)?;
            counter(b, spot, wide);
        }
        "fridge" => {
            let spot = room.at_wall(s, 0.7, 0.75, 0.4)?;
            fridge(b, spot);
        }
        "lamp" => {
            let [x, y] = room.amid(s, 0.45)?;
            lamp(b, at(x, y, 0.0), s.between(1.2, 1.7));
        }
        "plant" => {
            let [x, y] = room.amid(s, 0.55)?;
            plant(b, at(x, y, 0.0), s);
        }
        "chair" => {
            let [x, y] = room.amid(s, 0.7)?;
            let yaw_deg = s.between(0.0, 360.0);
            any_chair(b, s, at(x, y, yaw_deg));
        }
        "picture" => {
            let size = [s.between(0.4, 1.2), s.between(0.3, 0.9)];
            // It hangs above what stands there.
            let spot = Room::new(room.area, Vec::new()).at_wall(s, size[0], 0.05, 0.0)?;
            picture(b, spot, size, s.between(1.25, 1.6));
        }
        _ => {
            let [x, y] = room.amid(s, 0.5)?;
            let yaw_deg = s.between(0.0, 90.0);
            clutter(b, at(x, y, yaw_deg), s);
        }
    }
    Some(())
}

/// A low cabinet with a television on it, or one that hangs on the wall.
fn stand_with_tv(b: &mut Builder, s: &mut Stream, room: &mut Room) -> Option<()> {
    let wide = s.between(0.7, 1.5);
    if s.uniform() < 0.25 {
        let spot = room.at_wall(s, wide, 0.2, 0.9)?;
        tv(b, spot, wide, s.between(0.9, 1.3));
        return Some(());
    }
    let size = [
        wide + s.between(0.1, 0.9),
        s.between(0.35, 0.5),
        s.between(0.35, 0.7),
    ];
    let doors = (s.uniform() * 4.0) as i32 + 1;
    let spot = room.at_wall(s, size[0], size[1], 0.9)?;
    cabinet(b, spot, size, doors);
    tv(b, spot, wide, size[2] + 0.1);
    Some(())
}

/// A table with chairs around it.
fn dining(b: &mut Builder, s: &mut Stream, room: &mut Room) -> Option<()> {
    let size = size(s, [[0.9, 1.9], [0.8, 1.0], [0.7, 0.78]]);
    let [x, y] = room.amid(s, size[0].max(size[1]) + 1.0)?;
    let yaw = if s.uniform() < 0.5 { 0.0 } else { 90.0_f32 };
    let (sin, cos) = yaw.to_radians().sin_cos();
    let place = |along: f32, across: f32, turn: f32| {
        at(
            x + cos * along - sin * across,
            y + sin * along + cos * across,
            yaw + turn,
        )
    };
    any_table(b, s, place(0.0, -size[1] / 2.0, 0.0), size);
    let seats = if size[0] > 1.3 { 2 } else { 1 };
    for side in [-1.0_f32, 1.0] {
        for seat in 0..seats {
            let along = size[0] * ((seat as f32 + 0.5) / seats as f32 - 0.5);
            let along = along + s.between(-0.08, 0.08);
            let across = side * (size[1] / 2.0 + s.between(0.05, 0.35));
            let turn = if side < 0.0 { 0.0 } else { 180.0 } + s.between(-20.0, 20.0);
            if s.uniform() < 0.85 {
                chair(b, place(along, across, turn));
            }
        }
    }
    for _ in 0..2 {
        let (along, across) = (s.between(-0.3, 0.3), s.between(-0.2, 0.2));
        let wide = s.between(0.05, 0.14);
        b.thing(OTHER, place(along, across, 0.0)).drum(
            [0.0, 0.0],
            [size[2], size[2] + s.between(0.08, 0.3)],
            [wide, wide * 0.8],
        );
    }
    Some(())
}

fn study_desk(b: &mut Builder, s: &mut Stream, room: &mut Room) -> Option<()> {
    let size = size(s, [[1.1, 1.9], [0.6, 0.85], [0.7, 0.78]]);
    let spot = room.at_wall(s, size[0], size[1], 0.8)?;
    desk(b, spot, size, s);
    let (sin, cos) = spot.yaw_deg.to_radians().sin_cos();
    let (along, across) = (s.between(-0.2, 0.2), size[1] + s.between(0.1, 0.35));
    let seat = at(
        spot.x + cos * along - sin * across,
        spot.y + sin * along + cos * across,
        spot.yaw_deg + 180.0 + s.between(-40.0, 40.0),
    );
    any_chair(b, s, seat);
    Some(())
}

fn any_chair(b: &mut Builder, s: &mut Stream, spot: Spot) {
    match s.uniform() < 0.5 {
        true => chair(b, spot),
        false => office_chair(b, spot),
    }
}

/// A table on four legs, or a round one on one foot.
fn any_table(b: &mut Builder, s: &mut Stream, spot: Spot, size: [f32; 3]) {
    if s.uniform() < 0.7 {
        return table(b, spot, size);
    }
    let [wide, deep, height] = size;
    let radius = (wide + deep) / 4.0;
    let middle = [0.0, deep / 2.0];
    b.thing(TABLE, spot)
        .drum(middle, [height - 0.04, height], [radius, radius])
        .drum(middle, [0.04, height - 0.04], [0.05, 0.05])
        .drum(middle, [0.0, 0.04], [radius * 0.6, radius * 0.5]);
}
