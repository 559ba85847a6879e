//! The `voxel_marker_publisher` node.

use std::process::ExitCode;

fn main() -> ExitCode {
    lattice_nodes::node::main(
        "voxel_marker_publisher",
        lattice_nodes::voxel_marker_publisher::node::start,
    )
}
