//! Standard output and standard error of the commands.
//!
//! A closed pipe, as from `head`, is not an error: further output
//! is dropped, and the command ends normally. Any other error of standard output fails the command.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::sync::{Mutex, PoisonError};

/// First error of standard output; nothing is written after it.
static FAILED: Mutex<Option<io::Error>> = Mutex::new(None);

/// `print!` for commands.
macro_rules! print {
    ($($text:tt)*) => { $crate::streams::out(format_args!($($text)*)) };
}

/// `println!` for commands.
macro_rules! println {
    () => { $crate::streams::out(format_args!("\n")) };
    ($($text:tt)*) => { $crate::streams::out(format_args!("{}\n", format_args!($($text)*))) };
}

/// `eprintln!` for commands.
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::streams::err(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes to standard output; [`finish`] returns its error, if any.
pub fn out(text: Arguments) {
    let mut failed = FAILED.lock().unwrap_or_else(PoisonError::into_inner);
    if failed.is_none() {
        *failed = io::stdout().write_fmt(text).err();
    }
}

/// Writes to standard error, ignoring its errors.
pub fn err(text: Arguments) {
    let _ = io::stderr().write_fmt(text);
}

/// Flushes standard output; fails if output was lost, unless its reader closed it.
pub fn finish() -> Result<(), String> {
    let mut failed = FAILED.lock().unwrap_or_else(PoisonError::into_inner);
    let error = failed.take().or_else(|| io::stdout().flush().err());
    match error {
        Some(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(format!("standard output: {error}"))
        }
        _ => Ok(()),
    }
}
