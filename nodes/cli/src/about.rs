//! `lattice about`: version, licence and features of this program.

use std::env::current_exe;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::CliResult;

/// Features of this build, in the order of `Cargo.toml`.
const FEATURES: &[(&str, bool)] = &[
    ("bags", cfg!(feature = "bags")),
    ("compressed_depth", cfg!(feature = "compressed_depth")),
    ("headset", cfg!(feature = "headset")),
    ("lab", cfg!(feature = "lab")),
    ("onnx", cfg!(feature = "onnx")),
    ("ort", cfg!(feature = "ort")),
    ("security", cfg!(feature = "security")),
    ("survey", cfg!(feature = "survey")),
    ("viewer", cfg!(feature = "viewer")),
    ("zenoh", cfg!(feature = "zenoh")),
];

/// Licence texts that the packages carry, from the folder above that of the program.
const LICENCES: &str = "share/lattice/licences.txt";

/// Options of `lattice about`.
#[derive(Args)]
pub struct About {
    /// Print the licence texts of all crates and C sources in this program
    #[arg(long, alias = "licenses")]
    licences: bool,
}

impl About {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let path = licences_of(&current_exe()?);
        if self.licences {
            let text = fs::read_to_string(&path)
                .map_err(|e| format!("{}: {e}; {}", path.display(), remedy()))?;
            print!("{text}");
            return Ok(());
        }
        let features = FEATURES.iter().filter(|(_, is_on)| *is_on);
        let features: Vec<_> = features.map(|(name, _)| *name).collect();
        println!("version   lattice {}", env!("CARGO_PKG_VERSION"));
        println!("licence   {}", env!("CARGO_PKG_LICENSE"));
        println!("features  {}", features.join(", "));
        match path.exists() {
            true => println!("licences  {}", path.display()),
            false => println!("licences  {}", remedy()),
        }
        Ok(())
    }
}

/// Place of the licence texts for a program at `program`.
fn licences_of(program: &Path) -> PathBuf {
    let prefix = program.parent().and_then(Path::parent);
    prefix.unwrap_or(Path::new("/")).join(LICENCES)
}

fn remedy() -> &'static str {
    "wheels and Debian packages have the texts; in the source, `.ci/licences nodes/cli/Cargo.toml` prints them"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn licences_are_found_from_the_folder_of_the_program() {
        for (program, text) in [
            ("/usr/bin/lattice", "/usr/share/lattice/licences.txt"),
            ("/v/bin/lattice", "/v/share/lattice/licences.txt"),
            ("/lattice", "/share/lattice/licences.txt"),
        ] {
            assert_eq!(licences_of(Path::new(program)), Path::new(text));
        }
    }
}
