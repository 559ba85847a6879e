//! The generated house: eight rooms, 20 x 12 m.

mod builder;
mod drawn;
mod furniture;
mod rooms;
mod walls;

use super::House;
use crate::AnyError;
use crate::simulate::random::{Purpose, Stream};
pub use builder::Builder;
use builder::Spot;
use std::collections::BTreeMap;

/// The classes, by number.
const CLASSES: &str = "wall floor ceiling tv cabinet desk table chair sofa bookshelf counter fridge \
                       bed door window curtain picture other";

const WALL: u16 = 0;
const FLOOR: u16 = 1;
const CEILING: u16 = 2;
const TV: u16 = 3;
const CABINET: u16 = 4;
const DESK: u16 = 5;
const TABLE: u16 = 6;
const CHAIR: u16 = 7;
const SOFA: u16 = 8;
const BOOKSHELF: u16 = 9;
const COUNTER: u16 = 10;
const FRIDGE: u16 = 11;
const BED: u16 = 12;
const DOOR: u16 = 13;
const WINDOW: u16 = 14;
const CURTAIN: u16 = 15;
const PICTURE: u16 = 16;
const OTHER: u16 = 17;

impl House {
    /// A furnished house of boxes and drums, 20 x 12 x 2.8 m from the origin on, no two rooms alike.
    /// Books, clutter and how chairs stand are up to the seed.
    pub fn generated(seed: u64) -> Result<House, AnyError> {
        let mut builder = Builder::default();
        let mut stream = Stream::new(seed, Purpose::GeneratedHouse, 0, 0);
        walls::build(&mut builder)?;
        rooms::furnish(&mut builder, &mut stream)?;
        House::from_mesh(builder.build()?, names())
    }
}

/// Names of the classes.
fn names() -> BTreeMap<u16, String> {
    let names = CLASSES.split_whitespace().map(str::to_owned);
    (0..).zip(names).collect()
}

fn between(stream: &mut Stream, low: f32, high: f32) -> f32 {
    low + (high - low) * stream.uniform() as f32
}

/// A line with its words and the numbers after them.
type Line<'a> = (&'a str, Vec<&'a str>, Vec<f32>);

/// The lines of a text, without comments.
fn lines(text: &str) -> impl Iterator<Item = Result<Line<'_>, AnyError>> {
    let lines = text
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| {
        let is_word = |word: &&str| word.starts_with(|c: char| c.is_ascii_alphabetic());
        let words: Vec<&str> = line.split_whitespace().take_while(is_word).collect();
        let numbers = line.split_whitespace().skip(words.len()).map(str::parse);
        Ok((line, words, numbers.collect::<Result<_, _>>()?))
    })
}
