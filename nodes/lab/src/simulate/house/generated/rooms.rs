//! Furniture of each room.

use super::builder::{Builder, Spot};
use super::furniture::{
    bed, bookshelf, cabinet, chair, clutter, counter, desk, fridge, lamp, office_chair, picture,
    plant, sofa, table, tv,
};
use super::{COUNTER, OTHER, between};
use crate::simulate::random::Stream;

/// Distance from the middle of a wall to furniture against it, m.
const GAP: f32 = 0.08;

/// Against a wall on the low or high side of x or y.
fn south(x: f32, wall_y: f32) -> Spot {
    Spot {
        x,
        y: wall_y + GAP,
        yaw_deg: 0.0,
    }
}

fn north(x: f32, wall_y: f32) -> Spot {
    Spot {
        x,
        y: wall_y - GAP,
        yaw_deg: 180.0,
    }
}

fn west(y: f32, wall_x: f32) -> Spot {
    Spot {
        x: wall_x + GAP,
        y,
        yaw_deg: -90.0,
    }
}

fn east(y: f32, wall_x: f32) -> Spot {
    Spot {
        x: wall_x - GAP,
        y,
        yaw_deg: 90.0,
    }
}

fn at(x: f32, y: f32, yaw_deg: f32) -> Spot {
    Spot { x, y, yaw_deg }
}

/// The same spot, moved and turned a little, as people leave chairs.
fn left_so(s: &mut Stream, spot: Spot) -> Spot {
    Spot {
        x: spot.x + between(s, -0.07, 0.07),
        y: spot.y + between(s, -0.07, 0.07),
        yaw_deg: spot.yaw_deg + between(s, -18.0, 18.0),
    }
}

pub(super) fn furnish(b: &mut Builder, s: &mut Stream) {
    living_room(b, s);
    dining_room(b, s);
    study(b, s);
    corridor(b, s);
    bedroom(b, s);
    bath(b);
    library(b, s);
    store(b, s);
}

fn living_room(b: &mut Builder, s: &mut Stream) {
    cabinet(b, south(4.6, 0.0), [2.2, 0.42, 0.5], 4);
    tv(b, south(4.5, 0.0), 1.25, 0.62);
    b.thing(OTHER, south(5.45, 0.0))
        .block([-0.08, 0.1, 0.5], [0.08, 0.34, 0.78]);
    b.thing(OTHER, south(3.65, 0.0))
        .drum([0.0, 0.2], [0.5, 0.82], [0.05, 0.09]);
    sofa(b, at(4.4, 4.4, 180.0), 2.1);
    sofa(b, at(1.5, 2.2, -80.0), 1.0);
    table(b, at(4.4, 2.2, 0.0), [1.1, 0.6, 0.42]);
    bookshelf(b, north(2.4, 6.5), [1.6, 2.0], s);
    cabinet(b, west(0.9, 0.0), [0.9, 0.4, 1.1], 2);
    lamp(b, at(6.9, 0.5, 0.0), 1.5);
    plant(b, at(0.5, 6.0, 0.0), s);
    picture(b, north(4.6, 6.5), [0.9, 0.6], 1.4);
    picture(b, east(1.1, 8.0), [0.5, 0.7], 1.3);
    picture(b, south(6.3, 0.0), [0.6, 0.4], 1.5);
    clutter(b, south(7.4, 0.0), s);
}

fn dining_room(b: &mut Builder, s: &mut Stream) {
    table(b, at(11.0, 2.0, 4.0), [1.7, 0.95, 0.75]);
    for (x, y, yaw) in [
        (10.5, 1.75, 0.0),
        (11.5, 1.8, 0.0),
        (10.4, 3.15, 180.0),
        (11.4, 3.2, 180.0),
        (9.85, 2.4, -90.0),
        (12.2, 2.55, 90.0),
    ] {
        let spot = left_so(s, at(x, y, yaw));
        chair(b, spot);
    }
    b.thing(OTHER, at(11.0, 2.5, 0.0))
        .drum([0.0, 0.0], [0.75, 0.97], [0.08, 0.13]);
    b.thing(OTHER, at(11.0, 2.45, 0.0))
        .drum([0.0, 0.0], [1.75, 1.95], [0.26, 0.12]);
    counter(b, north(12.6, 6.5), 2.4);
    fridge(b, east(4.4, 14.2));
    b.thing(COUNTER, east(2.4, 14.2))
        .block([-0.6, 0.0, 0.0], [0.6, 0.5, 0.95]);
    cabinet(b, west(0.8, 8.0), [1.0, 0.45, 1.9], 2);
    picture(b, west(5.3, 8.0), [0.7, 0.5], 1.4);
    plant(b, at(13.7, 0.6, 0.0), s);
}

fn study(b: &mut Builder, s: &mut Stream) {
    desk(b, east(3.0, 20.0), [1.6, 0.75, 0.74], s);
    let spot = left_so(s, at(18.6, 3.0, -90.0));
    office_chair(b, spot);
    bookshelf(b, north(18.4, 6.5), [1.2, 1.9], s);
    bookshelf(b, west(1.4, 14.2), [0.9, 1.2], s);
    cabinet(b, south(15.3, 0.0), [1.0, 0.5, 0.8], 3);
    picture(b, west(3.4, 14.2), [1.1, 0.8], 1.2);
    lamp(b, at(19.5, 0.5, 0.0), 1.6);
    sofa(b, south(17.3, 0.0), 1.4);
    clutter(b, at(16.9, 5.8, 30.0), s);
    clutter(b, at(19.6, 4.7, 100.0), s);
}

fn corridor(b: &mut Builder, s: &mut Stream) {
    cabinet(b, north(14.2, 7.9), [1.2, 0.3, 0.9], 3);
    cabinet(b, south(1.6, 6.5), [0.8, 0.32, 1.8], 2);
    picture(b, south(12.0, 6.5), [0.8, 0.6], 1.3);
    picture(b, north(10.2, 7.9), [0.4, 0.5], 1.4);
    picture(b, north(2.6, 7.9), [0.6, 0.8], 1.2);
    clutter(b, south(18.0, 6.5), s);
}

fn bedroom(b: &mut Builder, s: &mut Stream) {
    bed(b, west(9.9, 0.0), 1.7);
    cabinet(b, west(8.7, 0.0), [0.5, 0.4, 0.55], 1);
    cabinet(b, west(11.2, 0.0), [0.5, 0.4, 0.55], 1);
    cabinet(b, east(9.2, 6.3), [2.0, 0.6, 2.1], 3);
    tv(b, north(4.6, 12.0), 0.8, 1.0);
    cabinet(b, north(4.6, 12.0), [1.0, 0.4, 0.85], 2);
    let spot = left_so(s, at(5.6, 11.3, 150.0));
    chair(b, spot);
    picture(b, west(9.9, 0.0), [1.0, 0.4], 1.5);
    clutter(b, at(3.4, 8.3, 0.0), s);
}

fn bath(b: &mut Builder) {
    b.thing(OTHER, at(7.85, 11.9, 180.0))
        .block([-1.4, 0.0, 0.0], [1.4, 0.08, 0.58])
        .block([-1.4, 0.7, 0.0], [1.4, 0.78, 0.58])
        .block([-1.4, 0.0, 0.0], [-1.3, 0.78, 0.58])
        .block([1.3, 0.0, 0.0], [1.4, 0.78, 0.58])
        .block([-1.4, 0.0, 0.0], [1.4, 0.78, 0.15]);
    b.thing(COUNTER, east(9.6, 9.4))
        .block([-0.4, 0.0, 0.3], [0.4, 0.45, 0.85]);
    picture(b, east(9.6, 9.4), [0.7, 0.7], 1.2);
    b.thing(OTHER, west(9.2, 6.3))
        .drum([0.0, 0.45], [0.0, 0.4], [0.15, 0.2])
        .block([-0.2, 0.0, 0.0], [0.2, 0.2, 0.8]);
}

fn library(b: &mut Builder, s: &mut Stream) {
    bookshelf(b, west(9.0, 9.4), [1.8, 2.2], s);
    bookshelf(b, west(11.0, 9.4), [1.4, 2.2], s);
    bookshelf(b, east(9.1, 15.6), [1.6, 1.5], s);
    sofa(b, north(12.4, 12.0), 1.9);
    table(b, at(12.2, 9.7, 20.0), [0.9, 0.6, 0.5]);
    let spot = left_so(s, at(14.4, 10.9, -120.0));
    chair(b, spot);
    lamp(b, at(14.9, 11.5, 0.0), 1.4);
    plant(b, at(10.1, 8.4, 0.0), s);
    picture(b, east(10.9, 15.6), [0.8, 1.0], 1.1);
}

fn store(b: &mut Builder, s: &mut Stream) {
    cabinet(b, north(19.0, 11.0), [1.6, 0.5, 2.0], 2);
    table(b, west(9.6, 15.6), [1.5, 0.7, 0.9]);
    cabinet(b, east(8.9, 20.0), [1.2, 0.4, 1.4], 4);
    for (x, y) in [(16.1, 10.5), (16.7, 10.6), (17.2, 10.3), (16.2, 8.4)] {
        let turn = between(s, 0.0, 90.0);
        clutter(b, at(x, y, turn), s);
    }
}
