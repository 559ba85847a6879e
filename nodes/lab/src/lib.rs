//! The laboratory of Lattice: simulated machines and houses, the papers computed anew, evaluations and
//! benchmarks. A robot builds none of it.
#![deny(unsafe_code)]

pub mod bench;
pub mod datasets;
mod error;
pub mod evaluate;
mod labelled_ply;
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

use error::at;
pub use error::{AnyError, pool};
pub use report::{Report, markdown, write_report};
