//! Simulated machines and sites with a noise-free truth.
//!
//! `Bobcat` is the skid-steer loader of Ryde & Brünig 2011, section III.B: three SICK LMS200, one of
//! them on a turntable, and a SPAN-CPT-like INS, on an earth-moving `Site`. Everything is a pure function
//! of a seed and a time, so that any number of threads gives the same bytes.
//!
//! [`house`] is another world: a furnished house, a robot that maps it and a headset; [`rooms`] are of a few
//! rectangles.
//!
//! Times are nanoseconds since the start of the log. The map frame is east, north, up (metres) about the
//! middle of the site; `base_link` is forward, left, up on the ground in the middle of the wheels.

mod bobcat;
pub mod drive;
mod ground;
mod height_field;
pub mod house;
mod ins;
mod ins_error;
mod layout;
mod lms200;
mod loader;
mod mission;
mod obstacles;
mod person;
mod profile;
mod random;
pub mod rooms;
mod site;
mod spin64;
mod spline;
mod survey;
#[cfg(test)]
mod tests;
pub mod town;

pub use bobcat::{BASE_FROM_IMU_M, Laser};
pub(crate) use bobcat::{BASE_FROM_TURNTABLE_M, Bobcat, TURNTABLE_PERIOD_NS, base_from_imu};
pub use ins::INS_POSITION_RMS_M;
pub(crate) use ins::{InsSample, InsSamples};
pub(crate) use lms200::{BEAMS, Lms200Scan, MAX_RANGE_M, MIN_RANGE_M, RANGE_NOISE_M, SCAN_SPAN_NS};
pub(crate) use survey::Survey;
pub use survey::SurveyPattern;
