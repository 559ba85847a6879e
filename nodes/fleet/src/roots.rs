//! Roots: the folders in which a process of a cluster reads logs and reads and writes tables.

use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::Result;
use crate::files::at;

/// Folders with logs and tables, canonical.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Roots {
    folders: Vec<PathBuf>,
}

impl Roots {
    /// Roots at some folders, which must exist.
    pub fn new(folders: &[PathBuf]) -> Result<Roots> {
        let canonical = |folder: &PathBuf| {
            let canonical = folder.canonicalize().map_err(|error| at(folder, error))?;
            match canonical.is_dir() {
                true => Ok(canonical),
                false => Err(at(folder, "not a folder (`--root`)")),
            }
        };
        let folders = folders.iter().map(canonical).collect::<Result<Vec<_>>>()?;
        Ok(Roots { folders })
    }

    /// Fails unless a path is absolute, has no `..`, and lies below a root when its links are resolved.
    pub fn admit(&self, path: &Path) -> Result<PathBuf> {
        let has_parent = path.components().any(|part| part == Component::ParentDir);
        if !path.is_absolute() || has_parent {
            return Err(at(path, "a path must be absolute, without `..`"));
        }
        // A missing file has the error of one outside, so that a client does not learn which files exist.
        let canonical = path.canonicalize().unwrap_or_default();
        match self.folders.iter().any(|root| canonical.starts_with(root)) {
            true => Ok(canonical),
            false => Err(at(
                path,
                "not below a root of this process: it takes logs and tables below its --root only",
            )),
        }
    }

    /// Admits a log: a file, or a folder with its files.
    pub fn admit_log(&self, log: &Path) -> Result {
        let log = self.admit(log)?;
        if log.is_dir() {
            for entry in fs::read_dir(&log).map_err(|error| at(&log, error))? {
                self.admit(&entry.map_err(|error| at(&log, error))?.path())?;
            }
        }
        Ok(())
    }

    /// Admits a folder of tables with the folders to which a task writes.
    pub fn admit_tables(&self, tables: &Path) -> Result {
        self.admit(tables)?;
        for folder in ["parts", "tmp"] {
            self.admit(&tables.join(folder))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn paths_and_links_out_of_the_roots_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let outer = folder.path().canonicalize().unwrap();
        let root = outer.join("r\u{f6}\u{f6}t #1 50% [a]");
        let log = root.join("log");
        fs::create_dir_all(&log).unwrap();
        fs::write(outer.join("secret"), "x").unwrap();
        fs::write(log.join("log.mcap"), "x").unwrap();
        fs::create_dir_all(outer.join("r\u{f6}\u{f6}t #1 50% [a]b")).unwrap();
        let roots = Roots::new(std::slice::from_ref(&root)).unwrap();
        roots.admit_log(&log).unwrap();
        for outside in [
            outer.join("secret"),
            outer.join("r\u{f6}\u{f6}t #1 50% [a]b"),
            outer.clone(),
            root.join("../secret"),
            log.join(".."),
            root.join("missing"),
            PathBuf::from("log"),
            PathBuf::from("/etc/passwd"),
        ] {
            assert!(roots.admit(&outside).is_err(), "{}", outside.display());
        }
        symlink(outer.join("secret"), root.join("link")).unwrap();
        assert!(roots.admit(&root.join("link")).is_err());
        symlink(outer.join("secret"), log.join("hidden.mcap")).unwrap();
        assert!(roots.admit_log(&log).is_err());
        let tables = root.join("tables");
        fs::create_dir_all(tables.join("parts")).unwrap();
        symlink(&outer, tables.join("tmp")).unwrap();
        assert!(roots.admit_tables(&tables).is_err());
        fs::remove_file(tables.join("tmp")).unwrap();
        fs::create_dir(tables.join("tmp")).unwrap();
        roots.admit_tables(&tables).unwrap();
    }
}
