//! Makes messages of a package that is not in `lattice_msgs`, as a user's build script.

use lattice_msgs_generator::{GenerateError, Generator};

fn main() -> Result<(), GenerateError> {
    let generator = Generator::new().package("my_msgs", "definitions/my_msgs");
    generator.generate()
}
