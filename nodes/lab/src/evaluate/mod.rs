//! Calibration measured: four scenes of a house, wrong labels, starts that are off and none at all
//! (semantic_icp, section 5; issue 4, acceptance 4 and 6).
//!
//! A trial is a view of a scene with a share of wrong labels and a start; each method is run on it.
//! Results are lines of a file that grows and is continued; the report is made of all of them, failures
//! included.

mod adversarial;
mod calibration_regression;
mod chain;
mod figures;
mod files;
mod global_registration;
mod house;
mod initial_guess;
pub mod kitti;
mod many;
mod methods;
mod odometry;
mod pairs;
mod reliability;
mod report;
mod results;
mod rooms;
mod run;
mod runner;
mod scans;
mod settings;
mod statistics;
mod summary;
mod testbed;
mod town;
mod trial;
mod views;

pub use adversarial::{AdversarialScene, adversarial_report};
pub use chain::{ChainOptions, chain_report, chain_settings, run_chain};
pub use house::read_house;
pub use many::{Case, run_cases, settings_of};
pub use methods::competitors;
pub(crate) use methods::{color, letters, title};
pub use odometry::{OdometryLog, OdometryTrial, measure_log, odometry_report, run_odometry};
pub use reliability::reliability_report;
pub use report::report;
pub use results::Results;
pub use rooms::{RoomCase, map_of_capture, rooms_report};
pub use run::run;
pub use scans::{Scans, scans_report};
#[cfg(test)]
pub(crate) use settings::Cell;
pub use settings::{Pivot, Plan, Settings, Start};
pub(crate) use statistics::{
    LEAST_FOR_INTERVAL, Share, distinct, extent, median, median_interval, quantile,
};
pub use summary::Summary;
pub(crate) use summary::{PRINTED, Printed};
pub(crate) use testbed::Scenario;
pub use testbed::Testbed;
pub use town::{Pair, town_report};
pub(crate) use trial::{Bounds, OURS, Trial, WRONG};
pub use trial::{TIMED, TRACKED};
