//! Calibration measured: four scenes of a house, wrong labels, starts that are off and none at all
//! (semantic_icp, section 5; issue 4, acceptance 4 and 6).
//!
//! A trial is a view of a scene with a share of wrong labels and a start; each method is run on it.
//! Results are lines of a file that grows and is continued; the report is made of all of them, failures
//! included.

mod figures;
mod house;
pub mod kitti;
mod markdown;
mod methods;
mod results;
mod run;
mod settings;
mod start;
mod statistics;
mod summary;
mod trial;
mod world;

use std::path::PathBuf;

use crate::simulate::house::HouseError;
use lattice_core::lattice::LatticeError;
use lattice_core::registration::RegistrationError;
use thiserror::Error;

pub use figures::draw;
pub use house::read_house;
pub use markdown::markdown;
pub use methods::Baseline;
pub use results::{FILE, Results, ResultsError};
pub use run::run;
pub use settings::{Cell, FORMAT, Pivot, Plan, Settings, Start};
pub use statistics::{LEAST_FOR_INTERVAL, Share, median, median_interval, quantile};
pub use summary::{PRINTED, Printed, Summary};
pub use trial::{Bounds, Judged, OURS, TIMED, TRACKED, Trial, WRONG, WRONG_TIGHT};
pub use world::{Scenario, View, World};

/// Why an evaluation stopped.
#[derive(Debug, Error)]
pub enum EvaluateError {
    /// The house has no such view, or options are out of range.
    #[error("the house: {0}")]
    House(#[from] HouseError),
    /// The mesh of a house or the names of its classes cannot be read.
    #[error("{path}: {reason}")]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Lattice cells are not possible.
    #[error("{0}")]
    Lattice(#[from] LatticeError),
    /// A map or view cannot be registered.
    #[error("{0}")]
    Registration(#[from] RegistrationError),
    /// The results cannot be read or written.
    #[error("{0}")]
    Results(#[from] ResultsError),
    /// No threads could be had.
    #[error("{0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A report cannot be written.
    #[error("{path}: {reason}")]
    Report {
        /// Its file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// There is no such map.
    #[error("no map of that number")]
    NoMap,
    /// It was asked to end.
    #[error("ended before all trials were done")]
    Ended,
}
