//! Materials of things: colours and patterns, drawn by class.

use super::light::{Light, color};
use super::pattern::{Pattern, cell, noise, unit};
use super::recipes::{Recipe, recipes};
use crate::simulate::house::House;
use crate::simulate::house::regions::Thing;
use crate::simulate::random::{Purpose, Stream};
use nalgebra::Vector3;

/// The material of one thing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Material {
    base: Light,
    second: Light,
    pattern: Pattern,
    /// Length of the pattern, metres.
    length_m: f32,
    /// Cosine and sine of the turn of the pattern about the vertical.
    turn: [f32; 2],
    seed: u32,
    /// Share of light that is mirrored.
    pub gloss: f32,
    /// Light of its own.
    pub glow: f32,
}

/// Materials of all things of a house: things of a class differ, but for walls and ceilings, which in most houses
/// are of one paint.
pub(super) fn of_things(house: &House, seed: u64) -> Vec<Material> {
    let mut common = Stream::new(seed, Purpose::Materials, 0, 0);
    let is_common = common.uniform() < 0.6;
    let paint = common.uniform();
    let number_of = |name: &str| match (name, is_common) {
        ("wall", true) => 1,
        ("ceiling", _) => 2,
        _ => 0,
    };
    let things = house.regions.things.iter().zip(16_u64..);
    let material = |(thing, number): (&Thing, u64)| {
        let name = house.class_names.get(&thing.label);
        let name = name.map_or("other", String::as_str);
        let shared = number_of(name);
        let number = if shared > 0 { shared } else { number };
        let mut stream = Stream::new(seed, Purpose::Materials, 0, number);
        let of_class = recipes(name);
        let choice = match shared {
            0 => stream.uniform(),
            _ => paint,
        };
        let recipe = of_class.get((choice * of_class.len() as f64) as usize);
        Material::new(recipe.unwrap_or(&Recipe::GREY), &mut stream)
    };
    things.map(material).collect()
}

impl Material {
    fn new(recipe: &Recipe, stream: &mut Stream) -> Material {
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * stream.uniform();
        let hue = between(recipe.hue_deg);
        let saturation = between(recipe.saturation);
        let value = between(recipe.value);
        let base = color(hue, saturation, value);
        let other = between([0.0, 1.0]);
        let second = match other < 0.6 {
            // A shade of the same.
            true => base * between([0.45, 0.85]) as f32,
            false => color(
                between([0.0, 360.0]),
                saturation * between([0.5, 1.2]).min(1.0),
                between(recipe.value),
            ),
        };
        let angle = between([0.0, 1.0]);
        let (sin, cos) = match angle < 0.7 {
            true => (0.0, 1.0),
            false => (angle * 40.0).sin_cos(),
        };
        let patterns = recipe.patterns;
        let choice = (between([0.0, 1.0]) * patterns.len() as f64) as usize;
        let pattern = patterns.get(choice).copied().unwrap_or(Pattern::Plain);
        let [short, long] = match pattern {
            Pattern::Plain => [1.0, 1.0],
            Pattern::Mottled => [0.01, 0.12],
            Pattern::Stripes => [0.03, 0.25],
            Pattern::Checker => [0.03, 0.3],
            Pattern::Tiles => [0.15, 0.6],
            Pattern::Wood => [0.015, 0.06],
            Pattern::Books => [0.02, 0.06],
            Pattern::Painting => [0.06, 0.3],
        };
        Material {
            base,
            second,
            pattern,
            length_m: between([short, long]) as f32,
            turn: [cos as f32, sin as f32],
            seed: (between([0.0, 1.0]) * f64::from(u32::MAX)) as u32,
            gloss: between(recipe.gloss) as f32,
            glow: between(recipe.glow) as f32,
        }
    }

    /// Colour at a place of the thing, metres from its lowest corner, on a face with a normal.
    pub(super) fn albedo(&self, place_m: &Vector3<f32>, normal: &Vector3<f32>) -> Light {
        let [cos, sin] = self.turn;
        let (x, y, z) = (
            cos * place_m.x + sin * place_m.y,
            cos * place_m.y - sin * place_m.x,
            place_m.z,
        );
        let is_level = normal.z.abs() > 0.7;
        // Along the face, and across it.
        let across_x = (cos * normal.x + sin * normal.y).abs();
        let across_y = (cos * normal.y - sin * normal.x).abs();
        let (u, v) = match (is_level, across_x > across_y) {
            (true, _) => (x, y),
            (false, true) => (y, z),
            (false, false) => (x, z),
        };
        let length = self.length_m;
        let share = match self.pattern {
            Pattern::Plain => 0.0,
            Pattern::Mottled => {
                let fine = noise([x, y, z].map(|c| c / length), self.seed);
                let coarse = noise([x, y, z].map(|c| c / (5.0 * length)), self.seed);
                0.5 * (fine + coarse)
            }
            Pattern::Stripes => (cell(u, length).0.rem_euclid(2)) as f32,
            Pattern::Checker => {
                let squares = cell(u, length).0.wrapping_add(cell(v, length).0);
                squares.rem_euclid(2) as f32
            }
            Pattern::Tiles => {
                let ((i, s), (j, t)) = (cell(u, length), cell(v, length));
                let joint = 0.006 / length;
                match s < joint || t < joint {
                    true => 1.0,
                    false => 0.25 * unit([i, j, 0], self.seed),
                }
            }
            Pattern::Wood => self.wood(u, v),
            Pattern::Books if is_level => 0.3 * self.wood(u, v),
            Pattern::Books => return self.book(u, z),
            Pattern::Painting => return self.painting(u, v),
        };
        self.base + (self.second - self.base) * share
    }

    /// Boards with rings along u.
    fn wood(&self, u: f32, v: f32) -> f32 {
        let (board, _) = cell(v, 0.14);
        let tint = unit([board, 0, 7], self.seed);
        let bend = noise([u * 1.5, v * 6.0, tint * 40.0], self.seed);
        let ring = (std::f32::consts::TAU * (v / self.length_m + 3.0 * bend)).sin();
        (0.3 + 0.25 * ring + 0.4 * (tint - 0.3)).clamp(0.0, 1.0)
    }

    /// The back of a book, a gap between two, or a board.
    fn book(&self, u: f32, z: f32) -> Light {
        let (shelf, height) = cell(z, 0.33);
        let (number, across) = cell(u, self.length_m);
        let of_book = |what: i32| f64::from(unit([number, shelf, what], self.seed));
        if height < 0.08 {
            return self.base;
        }
        if height > 0.65 + 0.3 * of_book(1) as f32 || across < 0.06 {
            return self.base * 0.25;
        }
        let paint = color(
            360.0 * of_book(2),
            0.8 * of_book(3),
            0.15 + 0.7 * of_book(4),
        );
        match (0.4..0.5).contains(&height) {
            true => paint * 0.5,
            false => paint,
        }
    }

    /// Spots of some colours, with soft borders.
    fn painting(&self, u: f32, v: f32) -> Light {
        let bend = |seed: u32| {
            let place = [u / self.length_m, v / self.length_m, 0.5];
            noise(place, self.seed.wrapping_add(seed))
        };
        let hue = 360.0 * f64::from(bend(1)) + f64::from(self.seed % 360);
        let (saturation, value) = (0.3 + 0.7 * bend(2), 0.2 + 0.8 * bend(3));
        color(1.7 * hue, saturation.into(), value.into())
    }
}
