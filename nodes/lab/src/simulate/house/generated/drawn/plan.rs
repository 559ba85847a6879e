//! The plan of a drawn house: rooms in rows, walls with doors and windows between them.

use super::super::builder::{Builder, Spot};
use super::super::walls::{Opening, curtain, wall};
use super::furnish::Room;
use crate::simulate::random::Stream;

/// Rooms side by side and one behind the other, with the height of their walls.
pub(super) struct Plan {
    /// Positions of walls along x and along y, metres.
    x_m: Vec<f32>,
    y_m: Vec<f32>,
    pub(super) height_m: f32,
    /// Areas before doors, which stay free: from and to along x and y, metres.
    doorways: Vec<[f32; 4]>,
    walls: Vec<(Spot, f32, f32, Vec<Opening>)>,
    curtains: Vec<(Spot, f32)>,
}

/// Room that a door needs on both sides, metres.
const DOORWAY_M: f32 = 0.8;

impl Plan {
    pub(super) fn draw(s: &mut Stream) -> Plan {
        let columns = 2 + usize::from(s.uniform() < 0.5);
        let mut lines = |count: usize, low: f32, high: f32| {
            let mut at = vec![0.0];
            for _ in 0..count {
                let last = at.last().copied().unwrap_or(0.0);
                at.push(last + s.between(low, high));
            }
            at
        };
        let (x_m, y_m) = (lines(columns, 3.2, 6.5), lines(2, 3.2, 5.5));
        let mut plan = Plan {
            x_m,
            y_m,
            height_m: s.between(2.4, 3.1),
            doorways: Vec::new(),
            walls: Vec::new(),
            curtains: Vec::new(),
        };
        let (x, y) = (plan.x_m.clone(), plan.y_m.clone());
        for (line, &at) in y.iter().enumerate() {
            let is_outer = line == 0 || line + 1 == y.len();
            for ends in x.windows(2) {
                let [from, to] = [ends[0], ends[1]];
                let spot = Spot {
                    x: from,
                    y: at,
                    yaw_deg: 0.0,
                };
                plan.add(s, spot, [from, to], is_outer, line == 0);
            }
        }
        for (line, &at) in x.iter().enumerate() {
            let is_outer = line == 0 || line + 1 == x.len();
            for ends in y.windows(2) {
                let [from, to] = [ends[0], ends[1]];
                let spot = Spot {
                    x: at,
                    y: from,
                    yaw_deg: 90.0,
                };
                plan.add(s, spot, [from, to], is_outer, line > 0);
            }
        }
        plan
    }

    /// Adds a wall; `is_first` says that the room of an outer wall is on the left of its direction.
    fn add(
        &mut self,
        s: &mut Stream,
        spot: Spot,
        [from, to]: [f32; 2],
        is_outer: bool,
        is_first: bool,
    ) {
        let long = to - from;
        let opening = if is_outer {
            (s.uniform() < 0.65).then(|| self.window(s, &spot, [from, to], is_first))
        } else {
            (s.uniform() < 0.85).then(|| {
                let wide = s.between(0.8, 1.7).min(long - 0.9);
                let at = from + s.between(0.35, long - wide - 0.35);
                let leaf = (wide < 1.2 && s.uniform() < 0.7).then(|| s.between(-100.0, 100.0));
                self.keep_free(&spot, at, at + wide);
                Opening::Door(at, at + wide, leaf)
            })
        };
        self.walls
            .push((spot, from, to, opening.into_iter().collect()));
    }

    fn window(
        &mut self,
        s: &mut Stream,
        spot: &Spot,
        [from, to]: [f32; 2],
        is_first: bool,
    ) -> Opening {
        let wide = s.between(0.7, 2.2).min(to - from - 1.0);
        let at = from + s.between(0.5, to - from - wide - 0.5);
        let (sill, lintel) = (s.between(0.3, 1.2), s.between(1.9, 2.3));
        if s.uniform() < 0.45 {
            // Before the window, on the side of the room.
            let (sin, cos) = spot.yaw_deg.to_radians().sin_cos();
            let along = at - from - 0.1;
            let side = if is_first { 0.16 } else { -0.2 };
            let place = Spot {
                x: spot.x + cos * along - sin * side,
                y: spot.y + sin * along + cos * side,
                yaw_deg: spot.yaw_deg,
            };
            let drawn = s.between(0.3, 1.0) * (wide + 0.2);
            self.curtains.push((place, drawn));
        }
        Opening::Window(at, at + wide, sill, lintel)
    }

    fn keep_free(&mut self, spot: &Spot, from: f32, to: f32) {
        self.doorways.push(match spot.yaw_deg == 0.0 {
            true => [from, to, spot.y - DOORWAY_M, spot.y + DOORWAY_M],
            false => [spot.x - DOORWAY_M, spot.x + DOORWAY_M, from, to],
        });
    }

    pub(super) fn size_m(&self) -> [f32; 2] {
        [&self.x_m, &self.y_m].map(|lines| lines.last().copied().unwrap_or(0.0))
    }

    pub(super) fn build(&self, builder: &mut Builder, s: &mut Stream) {
        for (spot, from, to, openings) in &self.walls {
            wall(builder, *spot, *from, *to, openings, self.height_m);
        }
        for (spot, wide) in &self.curtains {
            // Nothing comes of it, but without it each seed had other furniture than networks were trained on.
            s.uniform();
            curtain(builder, *spot, *wide);
        }
    }

    pub(super) fn rooms(&self) -> Vec<Room> {
        let across = |x: &[f32]| {
            let along = self.y_m.windows(2);
            let room = |y: &[f32]| Room::new([x[0], x[1], y[0], y[1]], self.doorways.clone());
            along.map(room).collect::<Vec<Room>>()
        };
        self.x_m.windows(2).flat_map(across).collect()
    }
}
