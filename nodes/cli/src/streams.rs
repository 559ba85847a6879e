//! Standard output and standard error of the commands.
//!
//! A reader that closes its end of the pipe, as `head` does, has what it wants: what is written after that
//! is dropped, and the command ends as it would have. Any other error of standard output fails the command.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::sync::{Mutex, PoisonError};

/// The first error of standard output; nothing is written after it.
static FAILED: Mutex<Option<io::Error>> = Mutex::new(None);

/// `print!` of the commands.
macro_rules! print {
    ($($text:tt)*) => { $crate::streams::out(format_args!($($text)*)) };
}

/// `println!` of the commands.
macro_rules! println {
    () => { $crate::streams::out(format_args!("\n")) };
    ($($text:tt)*) => { $crate::streams::out(format_args!("{}\n", format_args!($($text)*))) };
}

/// `eprintln!` of the commands.
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::streams::err(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes to standard output; [`finish`] has the error, if there is one.
pub fn out(text: Arguments) {
    let mut failed = FAILED.lock().unwrap_or_else(PoisonError::into_inner);
    if failed.is_none() {
        *failed = io::stdout().write_fmt(text).err();
    }
}

/// Writes to standard error, whose errors nobody could read.
pub fn err(text: Arguments) {
    let _ = io::stderr().write_fmt(text);
}

/// Writes what is left; fails if standard output took less than all, unless its reader closed it.
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
