//! The survey of a robot with a depth camera on a walk through the house.

use super::House;
use super::camera::{Camera, Image, looking};
use super::regions::NO_REGION;
use crate::AnyError;
use crate::options::within;
use crate::simulate::random::{Purpose, Stream};
use lattice_core::cloud::Cloud;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Views from one place.
const VIEWS_A_STOP: usize = 8;

/// Options of the robot's survey.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SurveyOptions {
    /// Number of views, eight from each stop.
    pub views: usize,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Default for SurveyOptions {
    fn default() -> SurveyOptions {
        SurveyOptions {
            views: 384,
            width: 96,
            height: 72,
        }
    }
}

/// Horizontal field of view of an Asus Xtion, degrees.
pub(super) const HFOV_DEG: f64 = 58.0;
/// Height of the camera above the floor, metres.
const HEIGHT_M: f64 = 1.0;
/// Depths that are measured, metres.
pub(super) const RANGE_M: std::ops::RangeInclusive<f64> = 0.4..=4.5;
/// Standard deviations of the measured position (metres) and rotation (degrees) of a view, each axis.
const POSITION_NOISE_M: f64 = 0.008;
const ROTATION_NOISE_DEG: f64 = 0.15;
/// Wavering of the boundaries of labels in the image, pixels.
const BLEED_PX: f64 = 1.0;

/// Points in the map frame, each with its region.
#[derive(Clone, PartialEq, Debug)]
pub struct Survey {
    /// The points; the datum is the origin of the house in the map.
    pub cloud: Cloud,
    /// Region of each point as seen in the image, see [`House::regions`].
    pub regions: Vec<u16>,
    /// Measured position of the camera of each view, map frame, metres.
    pub sensors_m: Vec<Point3<f64>>,
}

/// Standard deviation of a depth, metres, after Nguyen, Izadi & Lovell 2012.
pub(super) fn depth_noise_m(depth_m: f64) -> f64 {
    0.0012 + 0.0019 * (depth_m - 0.4).powi(2)
}

impl Survey {
    /// Walks through the house; computed in parallel, the same on any number of threads.
    pub fn new(house: &House, options: &SurveyOptions, seed: u64) -> Result<Survey, AnyError> {
        let stops = stops_m(house, options.views, seed)?;
        let views = (0..options.views).into_par_iter();
        let views: Vec<_> = views
            .map(|view| view_from(house, options, seed, view, stop_m(&stops, view)))
            .collect();
        let datum_m = house.map_from_house().translation.vector;
        let mut survey = Survey {
            cloud: Cloud::from_points(0, datum_m, &[]),
            regions: Vec::new(),
            sensors_m: Vec::with_capacity(views.len()),
        };
        for view in views {
            survey.cloud.offsets_m.extend(view.offsets_m);
            survey.regions.extend(view.regions);
            survey.sensors_m.push(view.sensor_m);
        }
        Ok(survey)
    }
}

/// Poses of the robot's camera on its walk: of each view the true one, and the one that the robot measures. The
/// views of a [`Survey`] of the same seed and number.
pub fn robot_views(house: &House, views: usize, seed: u64) -> Result<Vec<RobotView>, AnyError> {
    let stops = stops_m(house, views, seed)?;
    let view = |view: usize| {
        let mut stream = Stream::new(seed, Purpose::RobotView, 0, view as u64);
        RobotView::new(house, stop_m(&stops, view), view, &mut stream)
    };
    Ok((0..views).map(view).collect())
}

/// A view of the robot: x forward, y left, z up.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RobotView {
    /// True pose of the camera in the house.
    pub truth: Isometry3<f64>,
    /// The pose as measured.
    pub measured: Isometry3<f64>,
}

impl RobotView {
    fn new(house: &House, stop_m: [f64; 2], view: usize, stream: &mut Stream) -> RobotView {
        let turn = (view % VIEWS_A_STOP) as f64 + stream.uniform();
        let yaw = turn * std::f64::consts::TAU / VIEWS_A_STOP as f64;
        let pitch = (-18.0 + 30.0 * stream.uniform()).to_radians();
        let truth = looking(house.free.above_m(stop_m, HEIGHT_M), yaw, pitch);
        let mut normal = |sigma: f64| Vector3::from_fn(|_, _| sigma * stream.normal());
        let error = Isometry3::from_parts(
            Translation3::from(normal(POSITION_NOISE_M)),
            UnitQuaternion::from_scaled_axis(normal(ROTATION_NOISE_DEG.to_radians())),
        );
        RobotView {
            truth,
            measured: truth * error,
        }
    }
}

fn stops_m(house: &House, views: usize, seed: u64) -> Result<Vec<[f64; 2]>, AnyError> {
    within("views", views as f64, 1.0, 2e4)?;
    let mut path = Stream::new(seed, Purpose::RobotPath, 0, 0);
    let stops = views.div_ceil(VIEWS_A_STOP);
    Ok(house.free.spread_m(stops, || path.uniform()))
}

/// Stop of a view. A small house has fewer places than asked for: stop again.
fn stop_m(stops_m: &[[f64; 2]], view: usize) -> [f64; 2] {
    let stop = stops_m.get(view / VIEWS_A_STOP % stops_m.len().max(1));
    *stop.unwrap_or(&[0.0; 2])
}

struct View {
    /// Points from the origin of the house, axes of the map, metres.
    offsets_m: Vec<[f32; 3]>,
    regions: Vec<u16>,
    sensor_m: Point3<f64>,
}

fn view_from(
    house: &House,
    options: &SurveyOptions,
    seed: u64,
    view: usize,
    stop_m: [f64; 2],
) -> View {
    let mut stream = Stream::new(seed, Purpose::RobotView, 0, view as u64);
    let RobotView { truth, measured } = RobotView::new(house, stop_m, view, &mut stream);
    let camera = Camera::new(options.width, options.height, HFOV_DEG);
    let image = Image::take(house, &truth, camera, RANGE_M.end() * 2.5);
    let regions = image.bled(BLEED_PX, &mut stream);
    let map_from_house = house.map_from_house();
    let mut made = View {
        offsets_m: Vec::with_capacity(camera.pixels()),
        regions: Vec::with_capacity(camera.pixels()),
        sensor_m: map_from_house * Point3::from(measured.translation.vector),
    };
    for (pixel, (depth_m, region)) in image.depths_m.iter().zip(regions).enumerate() {
        let noise = stream.normal();
        let seen = RANGE_M.contains(depth_m);
        if !seen || region == NO_REGION {
            continue;
        }
        let depth_m = depth_m + depth_noise_m(*depth_m) * noise;
        let in_house = measured * Point3::from(camera.direction(pixel) * depth_m);
        let offset_m = map_from_house.rotation * in_house.coords;
        made.offsets_m.push(offset_m.cast::<f32>().into());
        made.regions.push(region);
    }
    made
}
