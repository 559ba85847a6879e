//! Errors and threads of the laboratory.

use std::error::Error;
use std::fmt::Display;
use std::path::Path;

/// Any error on its way to the user.
pub type AnyError = Box<dyn Error + Send + Sync>;

/// Thread pool of `threads` threads, at least one.
pub fn pool(threads: usize) -> Result<rayon::ThreadPool, AnyError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1));
    Ok(pool.build()?)
}

/// Adds the path of a file to its error.
pub(crate) fn at<E: Display>(path: &Path) -> impl Fn(E) -> AnyError + use<E> {
    let path = path.to_owned();
    move |error| format!("{}: {error}", path.display()).into()
}
