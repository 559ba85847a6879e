//! `lattice link`: symbolic links named like the nodes.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::{CliResult, node};

/// Options of `lattice link`.
///
/// Called by the name of a node, this program runs that node: `DIR/lattice_mapper --ros-args ...`.
#[derive(Args)]
pub struct Link {
    /// Directory of the links; created if missing
    dir: PathBuf,
    /// Target of the links [default: this program]
    #[arg(long, value_name = "PATH")]
    to: Option<PathBuf>,
}

impl Link {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let target = match self.to {
            Some(target) => target,
            None => std::env::current_exe()?,
        };
        fs::create_dir_all(&self.dir)
            .map_err(|e| format!("cannot create {}: {e}", self.dir.display()))?;
        for name in node::names() {
            let link = self.dir.join(name);
            make(&target, &link).map_err(|e| format!("{}: {e}", link.display()))?;
            println!("{}", link.display());
        }
        Ok(())
    }
}

/// Creates a link; only an existing link is replaced.
fn make(target: &Path, link: &Path) -> std::io::Result<()> {
    if fs::symlink_metadata(link).is_ok_and(|found| found.is_symlink()) {
        fs::remove_file(link)?;
    }
    std::os::unix::fs::symlink(target, link).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => std::io::Error::new(
            ErrorKind::AlreadyExists,
            "the name exists and is not a link: remove it, or use another directory",
        ),
        _ => error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn older_links_are_replaced_and_files_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("lattice_mapper");
        for target in ["one", "two"] {
            make(Path::new(target), &link).unwrap();
            assert_eq!(fs::read_link(&link).unwrap(), Path::new(target));
        }
        let file = folder.path().join("bag_player");
        fs::write(&file, "mine").unwrap();
        assert!(make(Path::new("one"), &file).is_err());
        assert_eq!(fs::read(&file).unwrap(), b"mine");
    }
}
