//! The generated house: eight rooms, 20 x 12 m.

mod builder;
mod classes;
mod drawn;
mod furniture;
mod listing;
mod rooms;
mod walls;

use super::House;
use crate::AnyError;
use crate::simulate::random::{Purpose, Stream};
pub use builder::Builder;
use classes::names;

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
