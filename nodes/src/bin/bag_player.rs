//! The `bag_player` node.

use std::process::ExitCode;

fn main() -> ExitCode {
    match lattice_nodes::bag_player::run(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", lattice_nodes::bag_player::NAME);
            ExitCode::FAILURE
        }
    }
}
