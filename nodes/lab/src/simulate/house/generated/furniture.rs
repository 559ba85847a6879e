//! Pieces of furniture. Each has its back at y = 0 and its middle at x = 0; the front is towards +y.

use super::builder::{Builder, Spot};
use super::classes::{
    BED, BOOKSHELF, CABINET, CHAIR, COUNTER, DESK, FRIDGE, OTHER, PICTURE, SOFA, TABLE, TV,
};
use crate::simulate::random::Stream;

/// A screen of a width, its lower edge at a height.
pub(super) fn tv(b: &mut Builder, spot: Spot, width: f32, z: f32) {
    let high = z + width * 0.57;
    b.thing(TV, spot)
        .block([-width / 2.0, 0.12, z], [width / 2.0, 0.17, high])
        .block([-0.15, 0.1, z - 0.06], [0.15, 0.14, z + 0.1])
        .block([-0.25, 0.04, z - 0.08], [0.25, 0.26, z - 0.06]);
}

/// A low or high cabinet with doors.
pub(super) fn cabinet(b: &mut Builder, spot: Spot, [width, depth, height]: [f32; 3], doors: i32) {
    let cabinet = b.thing(CABINET, spot);
    cabinet.block([-width / 2.0, 0.0, 0.06], [width / 2.0, depth, height]);
    let door = width / doors.max(1) as f32;
    for i in 0..doors {
        let x = -width / 2.0 + i as f32 * door;
        cabinet.block(
            [x + 0.01, depth, 0.1],
            [x + door - 0.01, depth + 0.02, height - 0.03],
        );
        let knob = [x + door - 0.08, depth + 0.02, height * 0.55];
        cabinet.block(knob, [knob[0] + 0.03, knob[1] + 0.03, knob[2] + 0.1]);
    }
}

/// A plate on four legs; `label` says whether it is a desk or a table.
fn plate(b: &mut Builder, label: u16, spot: Spot, [width, depth, height]: [f32; 3]) {
    let plate = b.thing(label, spot);
    plate.block(
        [-width / 2.0, 0.0, height - 0.04],
        [width / 2.0, depth, height],
    );
    for x in [-width / 2.0 + 0.06, width / 2.0 - 0.11] {
        for y in [0.05, depth - 0.1] {
            plate.block([x, y, 0.0], [x + 0.05, y + 0.05, height - 0.04]);
        }
    }
}

pub(super) fn table(b: &mut Builder, spot: Spot, size: [f32; 3]) {
    plate(b, TABLE, spot, size);
}

/// A desk with drawers on one side, a screen and clutter on it.
pub(super) fn desk(b: &mut Builder, spot: Spot, [width, depth, height]: [f32; 3], s: &mut Stream) {
    plate(b, DESK, spot, [width, depth, height]);
    b.block(
        [width / 2.0 - 0.45, 0.05, 0.1],
        [width / 2.0 - 0.02, depth - 0.05, height - 0.04],
    );
    let x = s.between(-0.3, 0.1);
    b.thing(OTHER, spot)
        .block(
            [x - 0.3, 0.15, height + 0.1],
            [x + 0.3, 0.19, height + 0.46],
        )
        .block([x - 0.04, 0.17, height], [x + 0.04, 0.21, height + 0.12])
        .block(
            [x - 0.22, depth - 0.28, height],
            [x + 0.22, depth - 0.14, height + 0.03],
        );
    for _ in 0..4 {
        let (x, y) = (
            s.between(-width / 2.0 + 0.1, width / 2.0 - 0.2),
            s.between(0.3, depth - 0.15),
        );
        let high = height + s.between(0.02, 0.16);
        b.thing(OTHER, spot)
            .block([x, y, height], [x + 0.12, y + 0.1, high]);
    }
}

/// A chair; its seat is in the middle of the spot.
pub(super) fn chair(b: &mut Builder, spot: Spot) {
    let chair = b.thing(CHAIR, spot);
    chair.block([-0.22, -0.22, 0.43], [0.22, 0.22, 0.47]);
    chair.block([-0.22, -0.22, 0.47], [0.22, -0.18, 0.92]);
    for x in [-0.22, 0.18] {
        for y in [-0.22, 0.18] {
            chair.block([x, y, 0.0], [x + 0.04, y + 0.04, 0.43]);
        }
    }
}

/// A chair on one foot with arms.
pub(super) fn office_chair(b: &mut Builder, spot: Spot) {
    b.thing(CHAIR, spot)
        .drum([0.0, 0.0], [0.42, 0.5], [0.24, 0.26])
        .drum([0.0, 0.0], [0.08, 0.42], [0.04, 0.04])
        .drum([0.0, 0.0], [0.02, 0.08], [0.28, 0.12])
        .block([-0.2, -0.28, 0.55], [0.2, -0.22, 1.05])
        .block([-0.3, -0.15, 0.66], [-0.24, 0.15, 0.7])
        .block([0.24, -0.15, 0.66], [0.3, 0.15, 0.7]);
}

/// A bench with back and arms.
pub(super) fn sofa(b: &mut Builder, spot: Spot, width: f32) {
    let half = width / 2.0;
    b.thing(SOFA, spot)
        .block([-half, 0.05, 0.08], [half, 0.9, 0.42])
        .block([-half, 0.0, 0.08], [half, 0.25, 0.85])
        .block([-half, 0.05, 0.08], [-half + 0.2, 0.9, 0.62])
        .block([half - 0.2, 0.05, 0.08], [half, 0.9, 0.62])
        .block([-half + 0.3, 0.25, 0.42], [-half + 0.75, 0.42, 0.75]);
}

/// An open shelf with boards and books.
pub(super) fn bookshelf(b: &mut Builder, spot: Spot, [width, height]: [f32; 2], s: &mut Stream) {
    const DEPTH: f32 = 0.3;
    let half = width / 2.0;
    let shelf = b.thing(BOOKSHELF, spot);
    shelf.block([-half, 0.0, 0.0], [half, 0.02, height]);
    shelf.block([-half, 0.0, 0.0], [-half + 0.03, DEPTH, height]);
    shelf.block([half - 0.03, 0.0, 0.0], [half, DEPTH, height]);
    let boards = (height / 0.36) as i32;
    let step = (height - 0.1) / boards as f32;
    for board in 0..=boards {
        let z = 0.05 + board as f32 * step;
        shelf.block([-half, 0.0, z], [half, DEPTH, z + 0.025]);
        let mut x = -half + 0.05;
        while board < boards && x < half - 0.1 {
            let wide = s.between(0.02, 0.06);
            let high = s.between(0.18, step - 0.07);
            let deep = s.between(0.16, 0.26);
            if s.uniform() < 0.8 {
                shelf.block([x, 0.02, z + 0.025], [x + wide, deep, z + 0.025 + high]);
            } else {
                x += s.between(0.05, 0.25);
            }
            x += wide + 0.003;
        }
    }
}

/// A kitchen counter with a sink and cupboards above.
pub(super) fn counter(b: &mut Builder, spot: Spot, width: f32) {
    let half = width / 2.0;
    b.thing(COUNTER, spot)
        .block([-half, 0.0, 0.1], [half, 0.58, 0.86])
        .block([-half - 0.02, 0.0, 0.86], [half + 0.02, 0.63, 0.9])
        .drum([-half * 0.4, 0.3], [0.9, 1.15], [0.02, 0.02]);
    b.thing(CABINET, spot)
        .block([-half, 0.0, 1.45], [half * 0.55, 0.35, 2.1]);
    b.thing(OTHER, spot)
        .block([half * 0.3, 0.1, 0.9], [half * 0.3 + 0.45, 0.45, 1.18]);
    b.thing(OTHER, spot)
        .drum([-half * 0.75, 0.25], [0.9, 1.15], [0.08, 0.1]);
}

pub(super) fn fridge(b: &mut Builder, spot: Spot) {
    b.thing(FRIDGE, spot)
        .block([-0.34, 0.0, 0.03], [0.34, 0.64, 1.92])
        .block([-0.34, 0.64, 0.05], [0.34, 0.68, 1.2])
        .block([-0.34, 0.64, 1.22], [0.34, 0.68, 1.92])
        .block([0.24, 0.68, 0.7], [0.28, 0.73, 1.15]);
}

/// A bed with its head at the wall.
pub(super) fn bed(b: &mut Builder, spot: Spot, width: f32) {
    let half = width / 2.0;
    b.thing(BED, spot)
        .block([-half, 0.0, 0.0], [half, 0.06, 1.05])
        .block([-half, 0.06, 0.1], [half, 2.1, 0.3])
        .block([-half + 0.03, 0.06, 0.3], [half - 0.03, 2.05, 0.52])
        .block([-half + 0.1, 0.1, 0.52], [-0.05, 0.5, 0.64])
        .block([0.05, 0.1, 0.52], [half - 0.1, 0.5, 0.64]);
}

/// A framed picture on a wall, its lower edge at a height.
pub(super) fn picture(b: &mut Builder, spot: Spot, [width, height]: [f32; 2], z: f32) {
    b.thing(PICTURE, spot)
        .block([-width / 2.0, 0.0, z], [width / 2.0, 0.03, z + height])
        .block(
            [-width / 2.0 - 0.03, 0.0, z - 0.03],
            [-width / 2.0, 0.05, z + height + 0.03],
        )
        .block(
            [width / 2.0, 0.0, z - 0.03],
            [width / 2.0 + 0.03, 0.05, z + height + 0.03],
        );
}

/// A lamp on a pole.
pub(super) fn lamp(b: &mut Builder, spot: Spot, height: f32) {
    b.thing(OTHER, spot)
        .drum([0.0, 0.0], [0.0, 0.04], [0.16, 0.16])
        .drum([0.0, 0.0], [0.04, height], [0.015, 0.015])
        .drum([0.0, 0.0], [height - 0.1, height + 0.2], [0.22, 0.13]);
}

/// A plant in a pot.
pub(super) fn plant(b: &mut Builder, spot: Spot, s: &mut Stream) {
    let plant = b.thing(OTHER, spot);
    plant.drum([0.0, 0.0], [0.0, 0.35], [0.15, 0.2]);
    for _ in 0..9 {
        let (x, y) = (s.between(-0.25, 0.25), s.between(-0.25, 0.25));
        let z = s.between(0.45, 1.1);
        plant.drum([x, y], [z, z + 0.18], [0.02, 0.12]);
    }
    plant.drum([0.0, 0.0], [0.35, 1.0], [0.03, 0.02]);
}

/// A box or drum of some size on the floor.
pub(super) fn clutter(b: &mut Builder, spot: Spot, s: &mut Stream) {
    let size = [
        s.between(0.15, 0.4),
        s.between(0.15, 0.4),
        s.between(0.15, 0.6),
    ];
    let thing = b.thing(OTHER, spot);
    if s.uniform() < 0.6 {
        thing.block(
            [-size[0] / 2.0, 0.0, 0.0],
            [size[0] / 2.0, size[1], size[2]],
        );
    } else {
        thing.drum(
            [0.0, size[0] / 2.0],
            [0.0, size[2]],
            [size[0] / 2.2, size[0] / 2.0],
        );
    }
}
