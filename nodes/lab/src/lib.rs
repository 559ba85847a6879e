//! The laboratory of Lattice: simulated machines and houses, the papers computed anew, evaluations and
//! benchmarks. A robot builds none of it.
#![deny(unsafe_code)]

use std::error::Error;
use std::fmt::Display;
use std::path::Path;

pub mod bench;
pub mod datasets;
pub mod evaluate;
mod matching;
pub use lattice_nodes::mesh;
pub mod metrics;
pub mod models;
mod options;
pub mod paper;
pub mod paper_values;
pub mod poses;
pub mod random;
pub mod render;
mod report;
pub mod simulate;
pub mod theory;

pub use report::{Report, markdown, write_report};

/// Any error on its way to the user.
pub type AnyError = Box<dyn Error + Send + Sync>;

/// Thread pool of `threads` threads, at least one.
pub fn pool(threads: usize) -> Result<rayon::ThreadPool, AnyError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1));
    Ok(pool.build()?)
}

/// Adds the path of a file to its error.
fn at<E: Display>(path: &Path) -> impl Fn(E) -> AnyError + use<E> {
    let path = path.to_owned();
    move |error| format!("{}: {error}", path.display()).into()
}
