//! `lattice fleet`: executes the separate program `lattice-fleet`.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;

use crate::CliResult;

/// Name of the program.
const PROGRAM: &str = "lattice-fleet";

/// Options of `lattice fleet`.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub struct Fleet {
    /// Command and options of lattice-fleet
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "COMMAND"
    )]
    arguments: Vec<OsString>,
}

impl Fleet {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        execute(self.arguments)
    }

    /// Runs a command of `lattice-fleet` under another name.
    pub fn run_as(self, command: &str) -> CliResult {
        let mut arguments = vec![command.into()];
        arguments.extend(self.arguments);
        execute(arguments)
    }
}

/// Replaces this process by `lattice-fleet`, which then receives its signals. Returns if that fails.
fn execute(arguments: Vec<OsString>) -> CliResult {
    let program = program();
    let error = Command::new(&program).args(&arguments).exec();
    Err(not_started(&program, &error).into())
}

/// Runs `lattice-fleet` with these arguments and waits for it.
#[cfg(feature = "bags")]
pub fn run(arguments: Vec<OsString>) -> CliResult {
    let program = program();
    let status = Command::new(&program).args(&arguments).status();
    let status = status.map_err(|error| not_started(&program, &error))?;
    match status.code() {
        Some(0) => Ok(()),
        // The program has printed the reason.
        Some(code) => std::process::exit(code),
        None => Err(format!("{PROGRAM} was killed: {status}").into()),
    }
}

fn not_started(program: &Path, error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => format!(
            "the program {PROGRAM} with the data engine is not installed; it is built separately: \
             cargo install --path nodes/fleet"
        ),
        _ => format!("{}: {error}", program.display()),
    }
}

fn program() -> PathBuf {
    beside_this().unwrap_or_else(|| PROGRAM.into())
}

/// The program beside this one, if it exists.
fn beside_this() -> Option<PathBuf> {
    let path = std::env::current_exe().ok()?.with_file_name(PROGRAM);
    path.is_file().then_some(path)
}
