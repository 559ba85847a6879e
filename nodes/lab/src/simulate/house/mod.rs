//! A furnished house, a robot that maps it, and a headset that looks at four of its corners.
//!
//! Made for the calibration of a headset to a robot map: a
//! [`House`] is a labelled mesh, of a real house or [`House::generated`], at a pose in the map, [`Survey`] the labelled points that a robot with
//! a depth camera gathers in it, [`HeadsetTrial`] what a headset sees of a [`Scene`] on its own coarse
//! mesh, with the true `map_from_headset`, [`LabelDraw`] labels of the two of which some are wrong, and
//! [`RoomImages`] what cameras see.
//! Everything depends on seeds alone, on any number of threads.
//!
//! The frame of the house is that of its mesh: metres, z up. Cameras look along their x axis, with y
//! to the left and z up.

mod building;
mod camera;
mod free_space;
mod generated;
pub(crate) use generated::Builder;
mod headset;
mod headset_mesh;
mod images;
mod labels;
mod laser;
mod messages;
mod regions;
mod robot;
mod scenes;
mod survey_map;
#[cfg(test)]
mod tests;
mod warp;

pub use building::House;
pub use headset::{HeadsetTrial, HouseScan};
pub use images::{RoomCamera, RoomImage, RoomImages, look_views};
pub use labels::{LabelDraw, RegionLabels};
pub(crate) use laser::LaserView;
pub use robot::{RobotView, Survey, SurveyOptions, robot_views};
pub use scenes::Scene;
pub use survey_map::SurveyMap;
