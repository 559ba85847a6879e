//! The `enu_transformer` node.

use std::process::ExitCode;

fn main() -> ExitCode {
    lattice_nodes::node::main(
        "enu_transformer",
        lattice_nodes::enu_transformer::node::start,
    )
}
