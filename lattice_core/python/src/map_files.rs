//! Map files, and atomic file writes: after an error the previous file stays.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use lattice_core::voxels::file::{MapContents, WriteOptions, max_voxels_of};
use pyo3::PyResult;

use crate::errors::{of_map_file, of_path};
use crate::threads::Stop;

/// Reads a map file.
pub fn load(path: &Path, stop: &Stop) -> PyResult<MapContents> {
    let system = |error: io::Error| of_path(path, &error);
    let file = File::open(path).map_err(system)?;
    let bytes = file.metadata().map_err(system)?.len();
    let reader = Stoppable { file, stop };
    MapContents::read(BufReader::new(reader), max_voxels_of(bytes))
        .map_err(|error| of_map_file(path, &error))
}

/// Writes a map file.
pub fn save(map: &MapContents, path: &Path, options: &WriteOptions, stop: &Stop) -> PyResult<()> {
    let write = |file: &mut File| {
        let writer = Stoppable { file, stop };
        map.write(BufWriter::with_capacity(1 << 16, writer), options)
            .map_err(|error| of_map_file(path, &error))
    };
    replace(path, write, stop)
}

/// Writes a temporary file beside the existing one, then replaces it. A pipe or device is written directly.
pub fn replace(
    path: &Path,
    write: impl Fn(&mut File) -> PyResult<()>,
    stop: &Stop,
) -> PyResult<()> {
    let system = |error: io::Error| of_path(path, &error);
    let found = fs::metadata(path);
    if found.as_ref().is_ok_and(|found| found.is_dir()) {
        return Err(system(io::Error::from_raw_os_error(libc::EISDIR)));
    }
    if found.as_ref().is_ok_and(|found| !found.is_file()) {
        let mut file = File::options().write(true).open(path).map_err(system)?;
        return write(&mut file);
    }
    let mut beside = Beside::create(path).map_err(system)?;
    if let Ok(found) = found {
        let kept = beside.file.set_permissions(found.permissions());
        kept.map_err(system)?;
    }
    write(&mut beside.file)?;
    beside.file.sync_all().map_err(system)?;
    if stop.is_set() {
        return Err(system(io::Error::from_raw_os_error(libc::EINTR)));
    }
    fs::rename(&beside.path, path).map_err(system)?;
    beside.path = PathBuf::new();
    Ok(())
}

/// Temporary file in the folder of another; removed unless its path is taken.
struct Beside {
    file: File,
    path: PathBuf,
}

impl Beside {
    fn create(path: &Path) -> io::Result<Beside> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let missing = || io::Error::from_raw_os_error(libc::ENOENT);
        let name = path.file_name().ok_or_else(missing)?;
        loop {
            let mut own = OsString::from(".");
            own.push(name);
            let (process, number) = (std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
            own.push(format!(".{process}-{number}"));
            let path = path.with_file_name(own);
            match File::options().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok(Beside { file, path }),
                // Left by a killed process of the same number.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        if self.path != PathBuf::new() {
            // Independent of the error being returned.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// File that fails after its call was interrupted.
pub struct Stoppable<'a, F> {
    pub file: F,
    pub stop: &'a Stop,
}

impl<F> Stoppable<'_, F> {
    fn check(&self) -> io::Result<()> {
        // Not `Interrupted`, after which writers retry.
        match self.stop.is_set() {
            true => Err(io::Error::other("interrupted")),
            false => Ok(()),
        }
    }
}

impl<F: Read> Read for Stoppable<'_, F> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.check()?;
        self.file.read(bytes)
    }
}

impl<F: Write> Write for Stoppable<'_, F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check()?;
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
