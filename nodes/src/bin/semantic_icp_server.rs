//! The `semantic_icp_server` node.

use std::process::ExitCode;

fn main() -> ExitCode {
    lattice_nodes::node::main(
        "semantic_icp_server",
        lattice_nodes::semantic_icp_server::node::start,
    )
}
