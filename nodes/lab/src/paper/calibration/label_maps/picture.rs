//! A scene from both sides, drawn alike: the robot's voxel map and the headset's points, by their labels.

use crate::AnyError;
use crate::evaluate::{Scenario, extent};
use crate::render::{Focus, LabelColors, RenderOptions, render_labels_png};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::registration::{MAX_NEIGHBORS, Neighbors, UNLABELED};
use lattice_core::voxels::{Payload, VoxelList};
use nalgebra::{Point3, Vector3};

/// Size of a picture, pixels.
pub(super) const SIZE: [u32; 2] = [440, 330];
/// Contrast of light and shadow: little, so that the colours are those of the key.
const CONTRAST: f64 = 0.6;
/// Steps between the levels of a channel that are kept, so that pictures are small.
const LEVELS: u32 = 15;
/// Height of the camera over the horizon, degrees.
const ELEVATION_DEG: f64 = 24.0;
/// Edge of the cubes that show headset points, metres: slightly above their spacing.
const POINT_M: f64 = 0.035;
/// Distance within which a voxel counts as the same position, in cell sizes.
const REACH_CELLS: f64 = 2.0;
/// Margin of the map around the view of the headset, metres.
const MARGIN_M: f64 = 0.3;

/// Points with one class each, map frame, metres.
#[derive(Clone, Debug, Default)]
pub(super) struct Labelled {
    pub points_m: Vec<Point3<f64>>,
    pub classes: Vec<u16>,
}

impl Labelled {
    fn push(&mut self, point_m: Point3<f64>, class: u16) {
        self.points_m.push(point_m);
        self.classes.push(class);
    }
}

/// Labelled voxels of both devices in the headset's view.
pub(super) struct Sides {
    /// Voxels of the robot in the view.
    pub robot: Labelled,
    /// Points of the headset at its true pose.
    pub headset: Labelled,
    /// Class of the robot's nearest voxel at each headset point, or the class of the point itself if a nearby voxel
    /// has it, since labels are blurred at the borders of objects.
    pub partners: Vec<u16>,
    /// Cell size of the robot's voxels, metres.
    cell_m: f64,
    view: Bounds,
}

/// A box along the headset's line of sight: forward, to its left and up.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    axes: [Vector3<f64>; 3],
    low_m: [f64; 3],
    high_m: [f64; 3],
}

impl Bounds {
    /// Box around points, with the horizontal viewing direction.
    fn about(forward: Vector3<f64>, points_m: &[Point3<f64>]) -> Bounds {
        let left = Vector3::z().cross(&forward);
        let axes = [forward, left, Vector3::z()];
        let ends = axes.map(|axis| extent(points_m.iter().map(|p| axis.dot(&p.coords))));
        let [low_m, high_m] = [0, 1].map(|end| ends.map(|ends| ends[end]));
        Bounds {
            axes,
            low_m,
            high_m,
        }
    }

    fn holds(&self, point: &Point3<f64>) -> bool {
        let ends = self.low_m.iter().zip(&self.high_m);
        self.axes.iter().zip(ends).all(|(axis, (low, high))| {
            let along = axis.dot(&point.coords);
            (low - MARGIN_M..=high + MARGIN_M).contains(&along)
        })
    }

    /// Centre and width of a picture that shows the whole box.
    fn focus(&self) -> Focus {
        let mut center = Vector3::zeros();
        let mut size_m = [0.0; 3];
        let ends = self.low_m.iter().zip(&self.high_m);
        for ((axis, size), (low, high)) in self.axes.iter().zip(&mut size_m).zip(ends) {
            center += axis * (0.5 * (low + high));
            *size = high - low + 2.0 * MARGIN_M;
        }
        let [depth_m, width_m, height_m] = size_m;
        let (sin, cos) = ELEVATION_DEG.to_radians().sin_cos();
        let tall_m = height_m * cos + depth_m * sin;
        let [width, height] = SIZE.map(f64::from);
        Focus {
            center_m: center.into(),
            width_m: width_m.max(tall_m * width / height),
        }
    }
}

impl Sides {
    /// Labelled voxels of a scenario whose map has this cell size.
    pub(super) fn new(scenario: &Scenario, cell_m: f64) -> Sides {
        let truth = &scenario.truth;
        let mut headset = Labelled::default();
        let mut eye_m = Point3::origin();
        for headset_scan in &scenario.headset_scans {
            for (i, point) in headset_scan.cloud.points_m.iter().enumerate() {
                let class = headset_scan.cloud.label(i).top().unwrap_or(UNLABELED);
                headset.push(truth * point, class);
            }
            eye_m = headset_scan.sensor_m.map_or(eye_m, |sensor| truth * sensor);
        }
        let sum = headset.points_m.iter().map(|p| p.coords - eye_m.coords);
        let sight = sum.sum::<Vector3<f64>>();
        let level = Vector3::new(sight.x, sight.y, 0.0);
        let forward = level.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let view = Bounds::about(forward, &headset.points_m);

        let map = scenario.map.cloud();
        let class = |i: usize| map.label(i).top().unwrap_or(UNLABELED);
        let mut robot = Labelled::default();
        for (i, point) in map.points_m().iter().enumerate() {
            if view.holds(point) {
                robot.push(*point, class(i));
            }
        }
        let mut found = Neighbors::default();
        let mut partner = |(p, mine): (&Point3<f64>, &u16)| {
            map.nearest_k(p, MAX_NEIGHBORS, REACH_CELLS * cell_m, &mut found);
            let mut classes = found.iter().map(|(i, _)| class(i));
            let nearest = classes.next().unwrap_or(UNLABELED);
            match nearest == *mine || classes.any(|class| class == *mine) {
                true => *mine,
                false => nearest,
            }
        };
        let points = headset.points_m.iter().zip(&headset.classes);
        Sides {
            partners: points.map(&mut partner).collect(),
            robot,
            headset,
            cell_m,
            view,
        }
    }

    /// Robot's voxels as a PNG.
    pub(super) fn robot_png(&self, colors: &LabelColors) -> Result<Vec<u8>, AnyError> {
        self.png(&self.robot, self.cell_m, colors)
    }

    /// Headset's points as a PNG.
    pub(super) fn headset_png(&self, colors: &LabelColors) -> Result<Vec<u8>, AnyError> {
        self.png(&self.headset, POINT_M, colors)
    }

    /// Headset's points as a PNG, coloured by the robot's voxel there: same class (0), another class (1), no voxel
    /// (2).
    pub(super) fn agreement_png(&self, colors: &LabelColors) -> Result<Vec<u8>, AnyError> {
        let pairs = self.headset.classes.iter().zip(&self.partners);
        let kind = |(mine, other): (&u16, &u16)| match *other {
            UNLABELED => 2,
            _ => u16::from(mine != other),
        };
        let agreement = Labelled {
            points_m: self.headset.points_m.clone(),
            classes: pairs.map(kind).collect(),
        };
        self.png(&agreement, POINT_M, colors)
    }

    fn png(&self, side: &Labelled, cell_m: f64, colors: &LabelColors) -> Result<Vec<u8>, AnyError> {
        let lattice = Lattice::new(LatticeKind::Cubic, cell_m.powi(3))?;
        let list = VoxelList::new(lattice, Vector3::zeros(), usize::MAX)?;
        let mut list = list.with_payload(Payload {
            labels: true,
            ..Payload::default()
        });
        let points_m: Vec<Vector3<f64>> = side.points_m.iter().map(|p| p.coords).collect();
        let cloud = Cloud::from_points(0, Vector3::zeros(), &points_m);
        list.insert_labelled(&cloud, &side.classes);
        let [forward, ..] = self.view.axes;
        // The camera stands behind the headset.
        let azimuth_deg = (-forward.x).atan2(-forward.y).to_degrees();
        let [width, height] = SIZE;
        let options = RenderOptions {
            width,
            height,
            azimuth_deg,
            elevation_deg: ELEVATION_DEG,
            contrast: CONTRAST,
            focus: Some(self.view.focus()),
        };
        let mut png = Vec::new();
        render_labels_png(&list, colors, &options, &mut png)?;
        smaller(&png)
    }
}

/// Picture with fewer colours, as palette indices if 256 colours are enough.
fn smaller(png: &[u8]) -> Result<Vec<u8>, AnyError> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info()?;
    let mut pixels = vec![0; reader.output_buffer_size().unwrap_or_default()];
    let info = reader.next_frame(&mut pixels)?;
    let level = |c: &u8| ((u32::from(*c) * LEVELS + 127) / 255 * 255 / LEVELS) as u8;
    let rgb = pixels.chunks_exact(info.color_type.samples());
    let rgb = rgb.map(|pixel| pixel.iter().take(3).map(level).collect::<Vec<u8>>());
    let rgb: Vec<Vec<u8>> = rgb.collect();
    let mut palette = rgb.clone();
    palette.sort_unstable();
    palette.dedup();

    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, info.width, info.height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let index = |pixel: &Vec<u8>| palette.binary_search(pixel).unwrap_or_default() as u8;
    let data: Vec<u8> = match palette.len() <= 256 {
        true => {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(palette.concat());
            encoder.set_filter(png::Filter::NoFilter);
            rgb.iter().map(index).collect()
        }
        false => {
            encoder.set_color(png::ColorType::Rgb);
            rgb.concat()
        }
    };
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&data)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_holds_what_it_is_about_and_little_more() {
        let forward = Vector3::new(0.6, 0.8, 0.0);
        let points = [Point3::new(3.0, 4.0, 0.0), Point3::new(6.0, 8.0, 2.0)];
        let bounds = Bounds::about(forward, &points);
        assert!(points.iter().all(|p| bounds.holds(p)));
        assert!(!bounds.holds(&Point3::new(3.0, 4.0, -0.5)));
        assert!(!bounds.holds(&Point3::new(2.4, 3.2, 1.0)));
        let focus = bounds.focus();
        let middle = Vector3::new(4.5, 6.0, 1.0);
        assert!((Vector3::from(focus.center_m) - middle).norm() < 1e-12);
        // 5.6 m of depth and 2.6 m of height, seen from above, are more than the width.
        let (sin, cos) = ELEVATION_DEG.to_radians().sin_cos();
        assert!((focus.width_m - (2.6 * cos + 5.6 * sin) * 4.0 / 3.0).abs() < 1e-9);
    }

    #[test]
    fn pictures_are_made_small_with_nearly_the_same_colours() {
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, 64, 2);
        encoder.set_color(png::ColorType::Rgba);
        let pixels: Vec<u8> = (0..128).flat_map(|i| [i, 255 - i, 7, 255]).collect();
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&pixels).unwrap();
        writer.finish().unwrap();
        let small = smaller(&png).unwrap();
        let mut decoder = png::Decoder::new(std::io::Cursor::new(small));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut found = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut found).unwrap();
        assert_eq!((info.width, info.height), (64, 2));
        for (before, after) in pixels.chunks(4).zip(found.chunks(3)) {
            for (a, b) in before.iter().zip(after) {
                assert!(a.abs_diff(*b) <= 9, "{before:?} {after:?}");
            }
        }
    }
}
