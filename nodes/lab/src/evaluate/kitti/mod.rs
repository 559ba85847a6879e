//! Registration of real laser scans with labels of a real network, against the truth of an INS
//! (semantic_icp, section 4; issue 4, acceptance 3).
//!
//! The scans, all and thinned, and the pairs with their truth are written to files too, so that other
//! programs can be run on the same.

mod files;
mod measure;
mod methods;
mod report;
mod scans;

pub use files::write_scans;
pub use measure::{KittiReport, Pair, PairRow, Prepared, RIGHT, pairs_of};
pub use methods::KittiMethod;
pub use report::kitti_report;
pub use scans::{KittiTopics, Scan, read_scans};
