//! The `lattice_mapper` node.

use std::process::ExitCode;

fn main() -> ExitCode {
    lattice_nodes::node::main("lattice_mapper", lattice_nodes::lattice_mapper::node::start)
}
