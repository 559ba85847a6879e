//! The folder `map_dir`: access for remote clients is restricted to its map files.

use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Seek};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex};

use lattice_core::voxels::file::{FileError, MapContents, WriteOptions, is_map};
use lattice_core::voxels::label_names::{LabelNames, read_label_names, short_name, write_named};
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_runtime::lock;
use lattice_runtime::params::{ParamError, Params};
use rustix::fs::{Mode, OFlags, open};
use thiserror::Error;

use crate::files::atomic_write::AtomicFile;
use crate::files::points::{PointFile, PointFileError, PointFileOptions, read_points};

/// Fast compression level.
const ZSTD_LEVEL: i32 = 3;

/// Reason for rejecting a map file, with the requested name.
#[derive(Debug, Error)]
pub(super) enum Refusal {
    #[error(
        "{0:?} is not a name below `map_dir`: absolute paths, `..`, links and hidden files are not allowed"
    )]
    Name(String),
    #[error("{0:?} is not a regular file")]
    NotAFile(String),
    #[error("{0:?} is not a map file")]
    NotAMap(String),
    #[error("{0:?} exists and is not a map file: it is not replaced")]
    NotOurs(String),
    #[error("{0:?}: {1}")]
    Io(String, io::Error),
    #[error("{0:?}: {1}")]
    Format(String, FileError),
    #[error("{0:?}: {1}")]
    Points(String, PointFileError),
}

/// The folder, and the label names written into its maps; clones share them.
#[derive(Clone)]
pub(super) struct MapFolder {
    folder: Arc<Path>,
    names: Arc<Mutex<LabelNames>>,
}

impl MapFolder {
    /// Opens an existing folder.
    pub(super) fn new(path: &str) -> io::Result<Self> {
        let folder = fs::canonicalize(path)?;
        match folder.is_dir() {
            true => Ok(Self {
                folder: folder.into(),
                names: Arc::default(),
            }),
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
        let format = |error| Refusal::Format(name.to_owned(), error);
        file.rewind().map_err(io)?;
        let contents = MapContents::read(BufReader::new(&mut file), max_voxels).map_err(format)?;
        file.rewind().map_err(io)?;
        let read = read_label_names(BufReader::new(file)).map_err(format)?;
        let mut names = lock(&self.names);
        // Names from `label_info` are newer.
        for (label, name) in read {
            names.entry(label).or_insert(name);
        }
        Ok(contents)
    }

    /// Reads a point file, such as an octree.
    pub(super) fn read_points(&self, name: &str) -> Result<PointFile, Refusal> {
        let path = self.place(name)?;
        regular_file(name, &path)?;
        let read = read_points(&path, &PointFileOptions::default());
        read.map_err(|error| Refusal::Points(name.to_owned(), error))
    }

    /// Sets label names for the maps written from now on.
    pub(super) fn name_labels(&self, info: &LabelInfo) {
        let classes = info.class_map.iter();
        let named = classes.map(|class| (class.class_id, short_name(&class.class_name).to_owned()));
        lock(&self.names).extend(named);
    }

    /// Writes a map; an existing file is replaced only if it is a map.
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
        let mut file = AtomicFile::create(&path).map_err(io)?;
        let names = match contents.payload().labels {
            true => lock(&self.names).clone(),
            false => LabelNames::new(),
        };
        let written = write_named(contents, &names, &mut file, &options);
        written.map_err(|error| Refusal::Format(name.to_owned(), error))?;
        file.finish().map_err(io)
    }

    /// Path of a name; no folder on the way may be a link.
    fn place(&self, name: &str) -> Result<PathBuf, Refusal> {
        let refusal = || Refusal::Name(name.to_owned());
        let mut path = self.folder.to_path_buf();
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

/// Opens a regular file; links and pipes are rejected without blocking.
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
    use lattice_core::voxels::{Payload, VoxelList};
    use lattice_msgs::vision_msgs::VisionClass;

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

    #[test]
    fn names_of_labels_are_kept_in_maps_with_labels_and_come_back_with_them() {
        let folder = tempfile::tempdir().unwrap();
        let open = || MapFolder::new(&folder.path().display().to_string()).unwrap();
        let named = |names: &[(u16, &str)]| LabelInfo {
            class_map: { names.iter() }
                .map(|&(class_id, name)| VisionClass {
                    class_id,
                    class_name: name.to_owned(),
                })
                .collect(),
            ..LabelInfo::default()
        };
        let lattice = Lattice::new(LatticeKind::Bcc, 0.125).unwrap();
        let list = VoxelList::new(lattice, Default::default(), 10).unwrap();
        let labelled = MapContents::from_list(&list.with_payload(Payload {
            labels: true,
            ..Payload::default()
        }));
        let first = open();
        first.name_labels(&named(&[(1, "wall"), (2, "door")]));
        first.write("labelled", &labelled).unwrap();
        first.write("plain", &contents()).unwrap();
        let read = |file: &str| {
            let file = File::open(folder.path().join(file)).unwrap();
            read_label_names(BufReader::new(file)).unwrap()
        };
        assert_eq!(read("labelled")[&2], "door");
        assert!(read("plain").is_empty());
        // A mapper that goes on from the file keeps them, and takes what is named anew.
        let second = open();
        second.name_labels(&named(&[(2, "gate")]));
        assert_eq!(second.read("labelled", 10).unwrap(), labelled);
        second.write("again", &labelled).unwrap();
        let again = read("again");
        assert_eq!([1, 2].map(|label| again[&label].as_str()), ["wall", "gate"]);
    }
}
