//! The `lattice` command: see `lattice --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    lattice_nodes::cli::main()
}
