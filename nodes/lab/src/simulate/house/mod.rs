//! A furnished house, a robot that maps it, and a headset that looks at four of its corners.
//!
//! Made for the calibration of a headset to a robot map: a
//! [`House`] is a labelled mesh, of a real house or [`House::own`], at a pose in the map, [`Survey`] the labelled points that a robot with
//! a depth camera gathers in it, [`HeadsetTrial`] what a headset sees of a [`Scene`] on its own coarse
//! mesh, with the true `map_from_headset`, and [`LabelModel`] how wrong the labels of the two are.
//! Everything depends on seeds alone, on any number of threads.
//!
//! The frame of the house is that of its mesh: metres, z up. Cameras look along their x axis, with y
//! to the left and z up.

mod camera;
mod error;
mod free_space;
mod headset;
mod headset_mesh;
mod labels;
mod laser;
mod own;
mod place;
mod regions;
mod robot;
mod scenes;
mod survey_map;
#[cfg(test)]
mod tests;
mod warp;

pub use error::HouseError;
pub use headset::{HeadsetHeadsetScan, HeadsetOptions, HeadsetTrial};
pub use labels::{FlipSide, LabelDraw, LabelModel, MEASURED_AGREEMENTS, RegionLabels};
pub use laser::{LaserOptions, LaserView};
pub use place::{House, SurfaceHit};
pub use regions::{NO_REGION, Region};
pub use robot::{Survey, SurveyOptions};
pub use scenes::Scene;
pub use survey_map::SurveyMap;
