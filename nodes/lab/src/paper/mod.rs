//! The two papers behind this library, each table and figure computed anew and set beside what is
//! printed: Ryde & Brünig 2011 (lattices) and Nakamura et al. (calibration).

pub mod calibration;
mod command;
mod estimate;
mod parallel;
mod sections;
mod streams;
pub mod voxels;
