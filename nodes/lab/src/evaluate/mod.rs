//! Calibration measured: four scenes of a house, wrong labels, starts that are off and none at all
//! (semantic_icp, section 5; issue 4, acceptance 4 and 6).
//!
//! A trial is a view of a scene with a share of wrong labels and a start; each method is run on it.
//! Results are lines of a file that grows and is continued; the report is made of all of them, failures
//! included.

mod figures;
mod house;
mod initial_guess;
pub mod kitti;
mod methods;
mod report;
mod results;
mod run;
mod settings;
mod statistics;
mod summary;
mod testbed;
mod trial;

pub use house::read_house;
pub use methods::{color, competitors, letters, title};
pub use report::report;
pub use results::{FILE, Results};
pub use run::run;
pub use settings::{Cell, FORMAT, Pivot, Plan, Settings, Start};
pub use statistics::{LEAST_FOR_INTERVAL, Share, extent, median, median_interval, quantile};
pub use summary::{PRINTED, Printed, Summary};
pub use testbed::{Scenario, Testbed, View};
pub use trial::{Bounds, Judged, OURS, TIMED, TRACKED, Trial, WRONG, WRONG_TIGHT};
