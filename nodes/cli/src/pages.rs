//! `lattice pages`: man pages and shell completions, for packages.

use std::fs::create_dir_all;
use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;

use crate::CliResult;

/// Options of `lattice pages`.
#[derive(Args)]
pub struct Pages {
    /// Directory of the files, as /usr/share; created if missing
    dir: PathBuf,
}

impl Pages {
    /// Writes the pages and completions of `lattice`, whose command this is.
    pub fn run(self, mut lattice: Command) -> CliResult {
        let man = self.dir.join("man/man1");
        create_dir_all(&man)?;
        clap_mangen::generate_to(lattice.clone(), &man)?;
        // The names that Debian's shells look for.
        for (shell, folder) in [
            (Shell::Bash, "bash-completion/completions"),
            (Shell::Zsh, "zsh/vendor-completions"),
            (Shell::Fish, "fish/vendor_completions.d"),
        ] {
            let folder = self.dir.join(folder);
            create_dir_all(&folder)?;
            let written = clap_complete::generate_to(shell, &mut lattice, "lattice", &folder)?;
            if shell == Shell::Bash {
                std::fs::rename(written, folder.join("lattice"))?;
            }
        }
        Ok(())
    }
}
