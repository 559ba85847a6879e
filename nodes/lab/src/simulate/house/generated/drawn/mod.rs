//! Houses whose plan, height and furniture are drawn: other rooms than those of [`House::generated`], for training.

mod furnish;
mod plan;

use super::builder::Builder;
use super::classes::{CEILING, FLOOR, names};
use crate::AnyError;
use crate::simulate::house::House;
use crate::simulate::random::{Purpose, Stream};
use plan::Plan;

impl House {
    /// Generates a house of four or six furnished rooms in two rows from a seed: walls, doors, windows, furniture,
    /// positions and sizes. Some rooms have no ceiling, as in many scans.
    ///
    /// No seed gives the rooms of [`House::generated`], so networks trained on such houses can be tested there.
    pub fn drawn(seed: u64) -> Result<House, AnyError> {
        let mut stream = Stream::new(seed, Purpose::DrawnHouse, 0, 0);
        let mut builder = Builder::default();
        let plan = Plan::draw(&mut stream);
        let [wide, deep] = plan.size_m();
        let floor = builder.fixed(FLOOR);
        floor.block([0.0, 0.0, -0.1], [wide, deep, 0.0]);
        if stream.uniform() < 0.7 {
            let ceiling = builder.fixed(CEILING);
            let height = plan.height_m;
            ceiling.block([0.0, 0.0, height], [wide, deep, height + 0.1]);
        }
        plan.build(&mut builder, &mut stream);
        for (number, room) in plan.rooms().into_iter().enumerate() {
            furnish::room(&mut builder, &mut stream, room, number);
        }
        House::from_mesh(builder.build()?, names())
    }
}
