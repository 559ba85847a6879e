//! The survey of a robot with a depth camera on a walk through the house.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::House;
use super::camera::{Camera, Image, looking};
use super::regions::NO_REGION;
use crate::AnyError;
use crate::options::within;
use crate::simulate::random::{Purpose, Stream};
use lattice_core::cloud::Cloud;

/// Views from one place.
const VIEWS_A_STOP: usize = 8;

/// Options of the robot's survey. The default is an Asus Xtion at 1 m.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SurveyOptions {
    /// Number of views, eight from each stop.
    pub views: usize,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Horizontal field of view, degrees.
    pub hfov_deg: f64,
    /// Height of the camera above the floor, metres.
    pub height_m: f64,
    /// Least depth that is measured, metres.
    pub min_range_m: f64,
    /// Greatest depth that is measured, metres.
    pub max_range_m: f64,
    /// Standard deviation of the measured position of a view, each axis, metres.
    pub position_noise_m: f64,
    /// Standard deviation of its measured rotation, each axis, degrees.
    pub rotation_noise_deg: f64,
    /// Wavering of the boundaries of labels in the image, pixels.
    pub bleed_px: f64,
}

impl Default for SurveyOptions {
    fn default() -> SurveyOptions {
        SurveyOptions {
            views: 384,
            width: 96,
            height: 72,
            hfov_deg: 58.0,
            height_m: 1.0,
            min_range_m: 0.4,
            max_range_m: 4.5,
            position_noise_m: 0.008,
            rotation_noise_deg: 0.15,
            bleed_px: 1.0,
        }
    }
}

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
        within("views", options.views as f64, 1.0, 2e4)?;
        let mut path = Stream::new(seed, Purpose::RobotPath, 0, 0);
        let stops = options.views.div_ceil(VIEWS_A_STOP);
        let stops = house.free.spread_m(stops, || path.uniform());
        let views: Vec<_> = (0..options.views)
            .into_par_iter()
            .map(|view| {
                // A small house has fewer places than asked for: stop again.
                let stop = stops.get(view / VIEWS_A_STOP % stops.len().max(1));
                view_from(house, options, seed, view, *stop.unwrap_or(&[0.0; 2]))
            })
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
    let turn = (view % VIEWS_A_STOP) as f64 + stream.uniform();
    let yaw = turn * std::f64::consts::TAU / VIEWS_A_STOP as f64;
    let pitch = (-18.0 + 30.0 * stream.uniform()).to_radians();
    let truth = looking(house.free.above_m(stop_m, options.height_m), yaw, pitch);
    let mut normal = |sigma: f64| Vector3::from_fn(|_, _| sigma * stream.normal());
    let error = Isometry3::from_parts(
        Translation3::from(normal(options.position_noise_m)),
        UnitQuaternion::from_scaled_axis(normal(options.rotation_noise_deg.to_radians())),
    );
    let measured = truth * error;
    let camera = Camera::new(options.width, options.height, options.hfov_deg);
    let image = Image::take(house, &truth, camera, options.max_range_m * 2.5);
    let regions = image.bled(options.bleed_px, &mut stream);
    let map_from_house = house.map_from_house();
    let mut made = View {
        offsets_m: Vec::with_capacity(camera.pixels()),
        regions: Vec::with_capacity(camera.pixels()),
        sensor_m: map_from_house * Point3::from(measured.translation.vector),
    };
    for (pixel, (depth_m, region)) in image.depths_m.iter().zip(regions).enumerate() {
        let noise = stream.normal();
        let seen = (options.min_range_m..=options.max_range_m).contains(depth_m);
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
