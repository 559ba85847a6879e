//! The folder `map_dir`: map files that anybody on the network may name, and nothing else of the machine.

use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Seek};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use lattice_core::voxels::file::{FileError, MapContents, WriteOptions, is_map};
use lattice_runtime::params::{ParamError, Params};
use rustix::fs::{Mode, OFlags, open};
use thiserror::Error;

use crate::files::whole::WholeFile;

/// Level that costs little time.
const ZSTD_LEVEL: i32 = 3;

/// Error of reading or writing a map file, by the name that was asked for.
#[derive(Debug, Error)]
pub(super) enum Refusal {
    #[error(
        "{0:?} is no name below `map_dir`: neither absolute paths nor `..`, links and hidden files"
    )]
    Name(String),
    #[error("{0:?} is not a regular file")]
    NotAFile(String),
    #[error("{0:?} is not a map file")]
    NotAMap(String),
    #[error("{0:?} is there and not a map file: it is not replaced")]
    NotOurs(String),
    #[error("{0:?}: {1}")]
    Io(String, io::Error),
    #[error("{0:?}: {1}")]
    Format(String, FileError),
}

/// The folder; clones are of the same.
#[derive(Clone)]
pub(super) struct MapFolder(Arc<Path>);

impl MapFolder {
    /// The folder of a path, which must be there.
    pub(super) fn new(path: &str) -> io::Result<Self> {
        let folder = fs::canonicalize(path)?;
        match folder.is_dir() {
            true => Ok(Self(folder.into())),
            false => Err(ErrorKind::NotADirectory.into()),
        }
    }

    /// Reads the parameter `map_dir`.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        let path = params.string("map_dir", ".")?;
        let problem = |error| params.invalid("map_dir", format!("{path:?}: {error}"));
        Self::new(&path).map_err(problem)
    }

    /// Reads a map.
    pub(super) fn read(&self, name: &str, max_voxels: usize) -> Result<MapContents, Refusal> {
        let mut file = regular_file(name, &self.place(name)?)?;
        if !is_map(&mut file) {
            return Err(Refusal::NotAMap(name.to_owned()));
        }
        let io = |error| Refusal::Io(name.to_owned(), error);
        file.rewind().map_err(io)?;
        let contents = MapContents::read(BufReader::new(file), max_voxels);
        contents.map_err(|error| Refusal::Format(name.to_owned(), error))
    }

    /// Writes a map, in place of an earlier one but of nothing else.
    pub(super) fn write(&self, name: &str, contents: &MapContents) -> Result<(), Refusal> {
        let path = self.place(name)?;
        match regular_file(name, &path) {
            Ok(found) => {
                if !is_map(found) {
                    return Err(Refusal::NotOurs(name.to_owned()));
                }
            }
            Err(Refusal::Io(_, error)) if error.kind() == ErrorKind::NotFound => {}
            Err(refusal) => return Err(refusal),
        }
        let io = |error| Refusal::Io(name.to_owned(), error);
        let options = WriteOptions {
            zstd_level: Some(ZSTD_LEVEL),
            ..WriteOptions::default()
        };
        let mut file = WholeFile::create(&path).map_err(io)?;
        let written = contents.write(&mut file, &options);
        written.map_err(|error| Refusal::Format(name.to_owned(), error))?;
        file.finish().map_err(io)
    }

    /// The path of a name; no folder on the way is a link.
    fn place(&self, name: &str) -> Result<PathBuf, Refusal> {
        let refusal = || Refusal::Name(name.to_owned());
        let mut path = self.0.to_path_buf();
        let mut parts = Path::new(name).components().peekable();
        if parts.peek().is_none() || name.ends_with('/') {
            return Err(refusal());
        }
        for part in parts {
            match part {
                Component::Normal(part) if !part.as_encoded_bytes().starts_with(b".") => {
                    path.push(part);
                }
                _ => return Err(refusal()),
            }
            if fs::symlink_metadata(&path).is_ok_and(|found| found.is_symlink()) {
                return Err(refusal());
            }
        }
        Ok(path)
    }
}

/// Opens a file; neither a link nor a pipe keeps the thread.
fn regular_file(name: &str, path: &Path) -> Result<impl Read + Seek + use<>, Refusal> {
    let io = |error| Refusal::Io(name.to_owned(), error);
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file: File = open(path, flags, Mode::empty())
        .map_err(|error| io(error.into()))?
        .into();
    match file.metadata().map_err(io)?.is_file() {
        true => Ok(file),
        false => Err(Refusal::NotAFile(name.to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::VoxelList;

    use super::*;

    fn contents() -> MapContents {
        let lattice = Lattice::new(LatticeKind::Bcc, 0.125).unwrap();
        let list = VoxelList::new(lattice, Default::default(), 10).unwrap();
        MapContents::from_list(&list)
    }

    #[test]
    fn names_lead_below_the_folder_and_nowhere_else() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("maps");
        fs::create_dir_all(folder.join("sub")).unwrap();
        let maps = MapFolder::new(&folder.display().to_string()).unwrap();
        maps.write("sub/site.lattice", &contents()).unwrap();
        let site = folder.join("sub/site.lattice");
        fs::copy(&site, outer.path().join("outside")).unwrap();
        symlink("sub/site.lattice", folder.join("link")).unwrap();
        symlink("sub", folder.join("linked")).unwrap();
        symlink("nowhere", folder.join("dangling")).unwrap();
        let absolute = site.display().to_string();
        let names = "../outside sub/../../outside link linked/site.lattice dangling .hidden . \
                     sub/ /";
        let names = names.split(' ').chain(["", &absolute]);
        for name in names {
            let refused = maps.read(name, 10).map(drop).unwrap_err();
            assert!(matches!(refused, Refusal::Name(_)), "{name}: {refused}");
            let refused = maps.write(name, &contents()).unwrap_err();
            assert!(matches!(refused, Refusal::Name(_)), "{name}: {refused}");
        }
        let refused = maps.read("sub", 10).map(drop).unwrap_err();
        assert!(matches!(refused, Refusal::NotAFile(_)), "{refused}");
        assert!(MapFolder::new(&absolute).is_err());
        assert_eq!(maps.read("sub/site.lattice", 10).unwrap(), contents());
    }

    #[test]
    fn a_file_that_is_no_map_is_neither_replaced_nor_shown() {
        let folder = tempfile::tempdir().unwrap();
        let maps = MapFolder::new(&folder.path().display().to_string()).unwrap();
        for secret in ["hunter2 and more", "hunter2", ""] {
            let path = folder.path().join("passwords");
            fs::write(&path, secret).unwrap();
            let refused = maps.read("passwords", 10).map(drop).unwrap_err();
            assert_eq!(refused.to_string(), "\"passwords\" is not a map file");
            let refused = maps.write("passwords", &contents()).unwrap_err();
            assert!(refused.to_string().contains("not replaced"), "{refused}");
            assert_eq!(fs::read_to_string(&path).unwrap(), secret);
        }
    }
}
