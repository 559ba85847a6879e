//! End of the program on SIGINT and SIGTERM: its child processes are killed and its temporary folders removed.

use std::collections::BTreeSet;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use tempfile::TempDir;

/// Child processes that run, and temporary folders that exist.
#[derive(Default)]
struct Held {
    children: BTreeSet<i32>,
    folders: BTreeSet<PathBuf>,
    is_stopping: bool,
}

static HELD: Mutex<Option<Held>> = Mutex::new(None);

/// Most attempts to remove a folder to which another thread still writes.
const REMOVALS: usize = 20;

fn held() -> MutexGuard<'static, Option<Held>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

fn stopping() -> io::Error {
    io::Error::new(io::ErrorKind::Interrupted, "stopped by a signal")
}

/// A temporary folder, removed when it is dropped and when a signal ends the program.
#[derive(Debug)]
pub struct Scratch {
    folder: Option<TempDir>,
}

impl Scratch {
    /// Creates a folder whose name begins with `prefix` in a folder.
    pub fn create(parent: &Path, prefix: &str) -> io::Result<Scratch> {
        let mut held = held();
        let held = held.get_or_insert_default();
        if held.is_stopping {
            return Err(stopping());
        }
        let folder = tempfile::Builder::new().prefix(prefix).tempdir_in(parent)?;
        held.folders.insert(folder.path().to_owned());
        Ok(Scratch {
            folder: Some(folder),
        })
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        self.folder.as_ref().map_or(Path::new(""), TempDir::path)
    }

    /// Moves the folder to its final place.
    pub fn persist(mut self, place: &Path) -> io::Result<()> {
        let from = self.path().to_owned();
        std::fs::rename(&from, place)?;
        held().get_or_insert_default().folders.remove(&from);
        if let Some(folder) = self.folder.take() {
            let _ = folder.keep();
        }
        Ok(())
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if let Some(folder) = self.folder.take() {
            let path = folder.path().to_owned();
            drop(folder);
            held().get_or_insert_default().folders.remove(&path);
        }
    }
}

/// Standard output and error of a program that is killed when this one ends.
pub fn output_of(mut command: Command) -> io::Result<Output> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    end_with_parent(&mut command);
    let child = {
        let mut held = held();
        let held = held.get_or_insert_default();
        if held.is_stopping {
            return Err(stopping());
        }
        let child = command.spawn()?;
        held.children.insert(process_id(&child));
        child
    };
    let id = process_id(&child);
    let output = child.wait_with_output();
    held().get_or_insert_default().children.remove(&id);
    output
}

fn process_id(child: &Child) -> i32 {
    i32::try_from(child.id()).unwrap_or(i32::MAX)
}

/// Has the kernel kill the child when this process ends in any way, SIGKILL included.
#[cfg(target_os = "linux")]
fn end_with_parent(command: &mut Command) {
    let parent = std::process::id();
    // SAFETY: prctl and getppid are async-signal-safe, and nothing is allocated.
    unsafe {
        command.pre_exec(move || {
            if libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) != 0 {
                return Err(io::Error::last_os_error());
            }
            // The parent may have ended before.
            match u32::try_from(libc::getppid()) == Ok(parent) {
                true => Ok(()),
                false => Err(io::Error::from_raw_os_error(libc::ESRCH)),
            }
        });
    }
}

#[cfg(not(target_os = "linux"))]
fn end_with_parent(_: &mut Command) {}

/// Handles SIGINT and SIGTERM from now on: children are killed, temporary folders removed, and the signal takes its
/// default action.
pub fn handle_signals() -> io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            if let Some(signal) = signals.forever().next() {
                end(signal);
            }
        })?;
    Ok(())
}

/// Waits for the end of the process if a signal has begun it.
pub fn wait_if_stopping() {
    while held().get_or_insert_default().is_stopping {
        std::thread::park();
    }
}

fn end(signal: i32) {
    let folders = {
        let mut held = held();
        let held = held.get_or_insert_default();
        held.is_stopping = true;
        for child in &held.children {
            // SAFETY: kill has no requirement. The identifier is of a child that was not waited for, or just was.
            unsafe { libc::kill(*child, libc::SIGKILL) };
        }
        std::mem::take(&mut held.folders)
    };
    for folder in &folders {
        // A thread that still writes may put a file into it meanwhile.
        let mut attempts = (0..REMOVALS).map(|_| std::fs::remove_dir_all(folder));
        let _ = attempts.find(|removed| removed.is_ok() || !folder.exists());
    }
    if signal_hook::low_level::emulate_default_handler(signal).is_err() {
        std::process::exit(128 + signal);
    }
}
