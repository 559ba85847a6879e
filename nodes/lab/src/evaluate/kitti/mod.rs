//! Registration of real laser scans with labels of a real network, against the truth of an INS
//! (semantic_icp, section 4; issue 4, acceptance 3).
//!
//! The scans, all and thinned, and the pairs with their truth are written to files too, so that other
//! programs can be run on the same.

mod files;
mod markdown;
mod measure;
mod methods;
mod scans;

use std::path::{Path, PathBuf};

use lattice_core::pose::{PoseMiss, TfInsertError, TfMiss};
use lattice_core::registration::RegistrationError;
use lattice_msgs::cdr::CdrError;
use thiserror::Error;

use lattice_bag::BagError;
use lattice_nodes::convert::semantic::SemanticError;

pub use files::write_scans;
pub use markdown::kitti_markdown;
pub use measure::{KittiReport, Pair, PairRow, Prepared, pairs_of};
pub use methods::{KittiMethod, OURS_TITLE};
pub use scans::{KittiTopics, Scan, read_scans};

/// A pose within it is right: metres and degrees.
pub const RIGHT: super::Bounds = super::Bounds { m: 0.15, deg: 0.3 };

/// Why scans cannot be evaluated.
#[derive(Debug, Error)]
pub enum KittiError {
    /// The log cannot be read.
    #[error("{0}")]
    Bag(#[from] BagError),
    /// A message is not what its type says.
    #[error("{topic}: {source}")]
    Message {
        /// Where it came.
        topic: String,
        /// What is wrong.
        source: CdrError,
    },
    /// A cloud has no labels, or no points.
    #[error("{topic}: {source}")]
    Cloud {
        /// Where it came.
        topic: String,
        /// What is wrong.
        source: SemanticError,
    },
    /// A static transform is not one.
    #[error("{0}")]
    Transform(#[from] TfInsertError),
    /// The sensor is not tied to the machine.
    #[error("{0}")]
    Frames(#[from] TfMiss),
    /// The INS says nothing at the time of a scan.
    #[error("scan {scan}: {source}")]
    Pose {
        /// Its number.
        scan: usize,
        /// What is wrong.
        source: PoseMiss,
    },
    /// There are no pairs, or too many.
    #[error("{topic} has {scans} scans, not 2 to {most}")]
    Scans {
        /// Where they came.
        topic: String,
        /// How many.
        scans: usize,
        /// The limit.
        most: usize,
    },
    /// A scan cannot be registered.
    #[error("{0}")]
    Registration(#[from] RegistrationError),
    /// A result cannot be written.
    #[error("{path}: {reason}")]
    Write {
        /// Its file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

fn cannot_write(path: &Path) -> impl Fn(std::io::Error) -> KittiError {
    let path = path.to_owned();
    move |error| KittiError::Write {
        path: path.clone(),
        reason: error.to_string(),
    }
}
