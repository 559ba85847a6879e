//! Atomic file writes: on a full disk, an error or a kill the previous file stays.

use std::error::Error;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, open};
use tempfile::{Builder, NamedTempFile, TempPath};

/// Boxed error for the user.
type AnyError = Box<dyn Error + Send + Sync>;

/// File being written; dropping it before [`AtomicFile::finish`] leaves no file.
pub struct AtomicFile {
    out: BufWriter<File>,
    place: Place,
}

/// Temporary location of a file.
enum Place {
    /// A pipe or device, written directly.
    There,
    /// Unnamed file (`O_TMPFILE`) for this path; it vanishes if the process ends before the link.
    Unnamed(PathBuf),
    /// Temporary file in the folder of this path, for file systems without unnamed files.
    Beside(TempPath, PathBuf),
}

impl AtomicFile {
    /// Creates a file for a path; fails if the folder is missing or not writable.
    pub fn create(path: &Path) -> io::Result<Self> {
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
            Ok(found) if !found.is_file() => {
                let file = File::options().write(true).open(path)?;
                Ok(Self::new(file, Place::There))
            }
            found => {
                let created = Self::beside(path, 0o666)?;
                if let Ok(found) = found {
                    created.out.get_ref().set_permissions(found.permissions())?;
                }
                Ok(created)
            }
        }
    }

    /// Creates a file of mode 0600 for a path, whatever the mode of the file before.
    #[cfg(feature = "viewer")]
    pub fn create_private(path: &Path) -> io::Result<Self> {
        Self::beside(path, 0o600)
    }

    /// Creates a file, of this mode at most, in the folder of the path.
    fn beside(path: &Path, mode: u32) -> io::Result<Self> {
        let to = path.to_owned();
        let folder = folder(path)?;
        if let Ok(file) = unnamed(&folder, mode) {
            return Ok(Self::new(file, Place::Unnamed(to)));
        }
        let mut named = Builder::new();
        let named = { named.prefix(".") }.permissions(fs::Permissions::from_mode(mode));
        let (file, at) = named.tempfile_in(folder)?.into_parts();
        Ok(Self::new(file, Place::Beside(at, to)))
    }

    fn new(file: File, place: Place) -> Self {
        let out = BufWriter::with_capacity(1 << 16, file);
        Self { out, place }
    }

    /// Syncs the data to disk, then replaces the path.
    pub fn finish(self) -> io::Result<()> {
        let file = self.out.into_inner().map_err(|error| error.into_error())?;
        let (named, to) = match self.place {
            Place::There => return Ok(()),
            Place::Unnamed(to) => {
                file.sync_all()?;
                (named(&file, &folder(&to)?)?.into_temp_path(), to)
            }
            Place::Beside(named, to) => {
                file.sync_all()?;
                (named, to)
            }
        };
        named.persist(&to).map_err(|error| error.error)?;
        // The file is complete; not every file system can sync its directory entry.
        let _ = File::open(folder(&to)?).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

/// The folder of a file.
fn folder(path: &Path) -> io::Result<PathBuf> {
    let no_name = || io::Error::new(ErrorKind::InvalidInput, "not the name of a file");
    path.file_name().ok_or_else(no_name)?;
    let parent = path.parent().filter(|folder| *folder != Path::new(""));
    Ok(parent.unwrap_or(Path::new(".")).to_owned())
}

fn unnamed(folder: &Path, mode: u32) -> io::Result<File> {
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    Ok(open(folder, flags, Mode::from_raw_mode(mode))?.into())
}

/// Gives an unnamed file a unique name.
fn named(file: &File, folder: &Path) -> io::Result<NamedTempFile<()>> {
    use std::os::fd::AsRawFd;
    let open = format!("/proc/self/fd/{}", file.as_raw_fd());
    let link = |path: &Path| {
        let follow = AtFlags::SYMLINK_FOLLOW;
        Ok(linkat(CWD, open.as_str(), CWD, path, follow)?)
    };
    Builder::new().prefix(".").make_in(folder, link)
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

/// Writes a file with a closure; errors begin with its path.
pub fn write<T, E: Into<AnyError>>(
    path: &Path,
    fill: impl FnOnce(&mut AtomicFile) -> Result<T, E>,
) -> Result<T, AnyError> {
    let named = |error: AnyError| -> AnyError { format!("{}: {error}", path.display()).into() };
    let mut file = AtomicFile::create(path).map_err(|error| named(error.into()))?;
    let filled = fill(&mut file).map_err(|error| named(error.into()))?;
    let finished = file.finish();
    finished.map_err(|error| named(error.into()))?;
    Ok(filled)
}

/// Writes a text file.
pub fn write_text(path: &Path, text: &str) -> Result<(), AnyError> {
    write(path, |file| file.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of the files in a folder.
    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string();
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| name(entry).unwrap()).collect()
    }

    #[test]
    fn a_writer_that_fails_leaves_the_file_before_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        for old in [None, Some("old")] {
            old.into_iter()
                .for_each(|text| fs::write(&path, text).unwrap());
            let failed = write(&path, |file| {
                file.write_all(&[7; 1 << 20])?;
                Err::<(), _>(io::Error::other("full"))
            });
            let error = failed.unwrap_err().to_string();
            assert!(error.ends_with("map: full"), "{error}");
            assert_eq!(fs::read_to_string(&path).ok().as_deref(), old);
            assert_eq!(names(folder.path()).len(), usize::from(old.is_some()));
        }
        write_text(&path, "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["map"]);
    }

    #[test]
    fn a_link_gives_way_and_what_it_leads_to_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (precious, link) = (folder.path().join("precious"), folder.path().join("link"));
        fs::write(&precious, "gold").unwrap();
        std::os::unix::fs::symlink(&precious, &link).unwrap();
        write_text(&link, "lead").unwrap();
        assert_eq!(fs::read_to_string(&precious).unwrap(), "gold");
        assert_eq!(fs::read_to_string(&link).unwrap(), "lead");
        assert!(!fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn modes_are_kept_and_folders_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("script");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o750)).unwrap();
        write_text(&path, "new").unwrap();
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o750);
        for nowhere in [
            folder.path(),
            &path.join("in"),
            Path::new(""),
            Path::new("/dev/full"),
        ] {
            assert!(write_text(nowhere, "text").is_err(), "{nowhere:?}");
        }
        write_text(Path::new("/dev/null"), "text").unwrap();
    }

    #[test]
    #[cfg(feature = "viewer")]
    fn a_private_file_is_its_owners_from_its_creation_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        let mut file = AtomicFile::create_private(&path).unwrap();
        let mode = |found: fs::Metadata| found.permissions().mode() & 0o777;
        assert_eq!(mode(file.out.get_ref().metadata().unwrap()), 0o600);
        file.write_all(b"new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        file.finish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(mode(fs::metadata(&path).unwrap()), 0o600);
        assert_eq!(names(folder.path()), ["key"]);
        assert!(
            AtomicFile::create_private(folder.path())
                .unwrap()
                .finish()
                .is_err()
        );
    }
}
