//! A depth camera that moves through a room, as a log, and its map by hand.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use lattice_bag::{BagWriter, Storage, TopicSpec, WriterOptions};
use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry::{header, transform_stamped};
use lattice_nodes::semantic_cloud::{
    CloudOptions, CloudOutput, LabelSource, SemanticCloud, Stream,
};
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;
use serde_bytes::ByteBuf;

pub const DEPTH: &str = "/camera/depth/image_rect_raw";
pub const FRAMES: i64 = 16;
const INFO: &str = "/camera/depth/camera_info";
const LABELS: &str = "/segmentation/labels";
/// Depth images in the frame of the colours.
pub const ALIGNED: &str = "/camera/aligned_depth_to_color/image_raw";
/// Clouds of the same depth images.
pub const CLOUDS: &str = "/camera/points";
const ALIGNED_INFO: &str = "/camera/aligned_depth_to_color/camera_info";
const COLORS: &str = "/camera/color/image_raw";
const COLOR_OPTICAL: &str = "camera_color_optical_frame";
const OPTICAL: &str = "camera_depth_optical_frame";
const START_NS: i64 = 1_700_000_000_000_000_000;
const PERIOD_NS: i64 = 66_000_000;
const WIDTH: u32 = 80;
const HEIGHT: u32 = 60;
const FOCAL: f64 = 64.0;
const CENTER: [f64; 2] = [39.3, 29.8];
/// Half the size of the room in x and y, and its height, m: in the middle of cells of 0.1 m.
const ROOM_M: [f64; 3] = [3.0, 2.0, 2.5];
/// Edge of a cell of the reference, m.
const CELL_M: f64 = 0.1;
/// Distance from the border of a cell at which single precision may choose the other one, m.
const BORDER_M: f64 = 1e-5;

/// Points by label of each cell.
pub type Cells = BTreeMap<[i64; 3], BTreeMap<u16, u32>>;

/// Contents of a log.
#[derive(Clone, Copy, Default)]
pub struct Log {
    pub is_compressed: bool,
    pub with_labels: bool,
    pub with_colors: bool,
    /// True if the log has the depth images in the frame of the colours too, and labels in that frame.
    pub with_aligned: bool,
    /// True if the log has clouds of the depth images.
    pub with_clouds: bool,
    /// True if the log has no calibration.
    pub without_info: bool,
    /// True if the log has no poses.
    pub without_poses: bool,
    /// Number of the image whose data are cut off.
    pub damaged: Option<i64>,
}

fn pose(frame: i64) -> Isometry3<f64> {
    let way = frame as f64 * 0.05;
    let turn = UnitQuaternion::from_euler_angles(0.02, -0.03, 0.3 * way);
    Isometry3::from_parts(Translation3::new(way - 0.5, 0.2 * way, 0.0), turn)
}

/// Pose of the camera's optical frame on the machine.
fn mount() -> Isometry3<f64> {
    let axes = [-Vector3::y(), -Vector3::z(), Vector3::x()];
    let optical = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&axes));
    let turn = UnitQuaternion::from_rotation_matrix(&optical);
    Isometry3::from_parts(Translation3::new(0.1, 0.0, 1.23), turn)
}

/// Depth in mm and label of each pixel.
fn seen(frame: i64) -> Vec<(u16, u8)> {
    let camera = pose(frame) * mount();
    let at = camera.translation.vector;
    let pixels = (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (column, row)));
    let look = |(column, row): (u32, u32)| {
        let ray = camera * ray(column, row);
        let [x, y, z] = [0, 1, 2].map(|i| match (i, ray[i] > 0.0) {
            (2, true) => (ROOM_M[2] - at[2]) / ray[2],
            (2, false) => -at[2] / ray[2],
            (_, true) => (ROOM_M[i] - at[i]) / ray[i],
            (_, false) => (-ROOM_M[i] - at[i]) / ray[i],
        });
        let nearest = [(x, 2), (y, 2), (z, 1)].into_iter();
        let (z_m, label) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        // A column of pixels without depth.
        match column {
            5 => (0, label),
            _ => ((z_m * 1e3).round() as u16, label),
        }
    };
    pixels.map(look).collect()
}

fn ray(column: u32, row: u32) -> Vector3<f64> {
    let x = (f64::from(column) - CENTER[0]) / FOCAL;
    let y = (f64::from(row) - CENTER[1]) / FOCAL;
    Vector3::new(x, y, 1.0)
}

/// Red, green and blue of a pixel.
fn color(column: u32, row: u32, label: u8) -> [u8; 3] {
    [label * 40, (3 * column) as u8, 255 - (4 * row) as u8]
}

/// Point of the map by hand.
struct Point {
    cell: [i64; 3],
    /// True if it is too near to a border of the cell.
    is_near: bool,
    label: u8,
    rgb: [u8; 3],
}

fn points(frame: i64) -> Vec<Point> {
    let camera = pose(frame) * mount();
    let pixels = (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (column, row)));
    let pixels = pixels.zip(seen(frame));
    let with_depth = pixels.filter(|(_, (depth_mm, _))| *depth_mm > 0);
    let point = |((column, row), (depth_mm, label)): ((u32, u32), (u16, u8))| {
        let seen = ray(column, row) * f64::from(depth_mm) * 1e-3;
        let point_m = camera.transform_point(&seen.into());
        let cell = [0, 1, 2].map(|i| (point_m[i] / CELL_M).round() as i64);
        let is_near = |i: usize| {
            let from_center_m = (point_m[i] - cell[i] as f64 * CELL_M).abs();
            from_center_m > 0.5 * CELL_M - BORDER_M
        };
        Point {
            cell,
            is_near: (0..3).any(is_near),
            label,
            rgb: color(column, row, label),
        }
    };
    with_depth.map(point).collect()
}

/// The cells of the first frames, and the number of points too near to a border.
pub fn reference(with_labels: bool, frames: impl IntoIterator<Item = i64>) -> (Cells, u32) {
    let (mut cells, mut near) = (Cells::new(), 0);
    for point in frames.into_iter().flat_map(points) {
        near += u32::from(point.is_near);
        let label = if with_labels {
            point.label.into()
        } else {
            u16::MAX
        };
        *cells
            .entry(point.cell)
            .or_default()
            .entry(label)
            .or_default() += 1;
    }
    (cells, near)
}

/// Number of points and sums of red, green and blue of each cell.
pub fn color_reference() -> BTreeMap<[i64; 3], (u32, [f64; 3])> {
    let mut cells = BTreeMap::<_, (u32, [f64; 3])>::new();
    for point in (0..FRAMES).flat_map(points) {
        let (count, sum) = cells.entry(point.cell).or_default();
        *count += 1;
        (sum.iter_mut().zip(point.rgb)).for_each(|(sum, value)| *sum += f64::from(value));
    }
    cells
}

/// Difference of two maps in points.
pub fn difference(a: &Cells, b: &Cells) -> u32 {
    let flat = |cells: &Cells| -> BTreeMap<([i64; 3], u16), u32> {
        let cells = cells.iter();
        let labels = cells.flat_map(|(cell, labels)| labels.iter().map(|(l, n)| ((*cell, *l), *n)));
        labels.collect()
    };
    let (a, b) = (flat(a), flat(b));
    let keys: std::collections::BTreeSet<_> = a.keys().chain(b.keys()).collect();
    let of = |cells: &BTreeMap<_, u32>, key| cells.get(key).copied().unwrap_or(0);
    keys.into_iter()
        .map(|key| of(&a, key).abs_diff(of(&b, key)))
        .sum()
}

fn image(stamp_ns: i64, encoding: &str, pixel_bytes: u32, data: Vec<u8>) -> Image {
    Image {
        header: header(OPTICAL, stamp_ns),
        height: HEIGHT,
        width: WIDTH,
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: WIDTH * pixel_bytes,
        data: ByteBuf::from(data),
    }
}

/// A depth image as compressed_depth_image_transport packs it.
fn compressed(stamp_ns: i64, depths_mm: &[u16]) -> CompressedImage {
    let mut data = vec![0; 12];
    let mut encoder = png::Encoder::new(&mut data, WIDTH, HEIGHT);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let rows: Vec<u8> = depths_mm.iter().flat_map(|mm| mm.to_be_bytes()).collect();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&rows).unwrap();
    writer.finish().unwrap();
    CompressedImage {
        header: header(OPTICAL, stamp_ns),
        format: "16UC1; compressedDepth png".to_owned(),
        data: ByteBuf::from(data),
    }
}

/// The cloud of a depth image, with the parameters of the replays.
fn cloud(info: CameraInfo, depth: Image) -> PointCloud2 {
    let mut options = CloudOptions {
        labels: LabelSource::None,
        ..CloudOptions::default()
    };
    options.points.edge_jump = f32::INFINITY;
    let mut machine = SemanticCloud::new(options);
    machine.on_camera_info(Arc::new(info));
    match machine.on_image(Stream::Depth, Arc::new(depth)).pop() {
        Some(CloudOutput::Points(points)) => points,
        other => panic!("{other:?}"),
    }
}

/// Messages of a log by time.
struct Messages {
    writer: BagWriter,
    topics: BTreeMap<String, usize>,
    messages: Vec<(i64, usize, Vec<u8>)>,
}

impl Messages {
    fn add<M: RosMessage + Serialize>(&mut self, name: &str, log_time_ns: i64, message: &M) {
        let topic = *self.topics.entry(name.to_owned()).or_insert_with(|| {
            let topic = TopicSpec {
                name: name.to_owned(),
                type_name: M::TYPE.to_owned(),
                type_hash: String::new(),
                definition: None,
                offered_qos: Vec::new(),
            };
            self.writer.add_topic(topic).unwrap()
        });
        let data = cdr::to_vec(message).unwrap();
        self.messages.push((log_time_ns, topic, data));
    }
}

impl Log {
    /// Name of the topic of the depth images.
    pub fn depth(&self) -> String {
        match self.is_compressed {
            true => format!("{DEPTH}/compressedDepth"),
            false => DEPTH.to_owned(),
        }
    }

    /// Writes the log.
    pub fn write(&self, path: &Path) {
        let options = WriterOptions::default();
        let mut log = Messages {
            writer: BagWriter::create(path, Storage::Mcap, options).unwrap(),
            topics: BTreeMap::new(),
            messages: Vec::new(),
        };
        let mounted = transform_stamped("base_link", OPTICAL, START_NS, &mount());
        let mut color = mounted.clone();
        COLOR_OPTICAL.clone_into(&mut color.child_frame_id);
        let transforms = vec![mounted, color];
        log.add(
            "/tf_static",
            START_NS - PERIOD_NS,
            &TFMessage { transforms },
        );
        for frame in -1..=FRAMES {
            let stamp_ns = START_NS + frame * PERIOD_NS;
            if !self.without_poses {
                let moved = transform_stamped("odom", "base_link", stamp_ns, &pose(frame));
                let transforms = vec![moved];
                log.add("/tf", stamp_ns, &TFMessage { transforms });
            }
            if (0..FRAMES).contains(&frame) {
                self.add_images(&mut log, frame, stamp_ns);
            }
        }
        log.messages.sort_by_key(|(time_ns, _, _)| *time_ns);
        for (time_ns, topic, data) in log.messages {
            log.writer.write(topic, time_ns, &data).unwrap();
        }
        log.writer.finish().unwrap();
    }

    fn add_images(&self, log: &mut Messages, frame: i64, stamp_ns: i64) {
        let pixels = seen(frame);
        let came_ns = stamp_ns + 20_000_000;
        let info = CameraInfo {
            header: header(OPTICAL, stamp_ns),
            height: HEIGHT,
            width: WIDTH,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.0; 5],
            k: [FOCAL, 0.0, CENTER[0], 0.0, FOCAL, CENTER[1], 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        };
        if !self.without_info {
            log.add(INFO, came_ns, &info);
        }
        let depths_mm: Vec<u16> = pixels.iter().map(|(mm, _)| *mm).collect();
        if self.is_compressed {
            log.add(
                &self.depth(),
                came_ns + 1,
                &compressed(stamp_ns, &depths_mm),
            );
        } else {
            let mut data: Vec<u8> = depths_mm.iter().flat_map(|mm| mm.to_le_bytes()).collect();
            if self.damaged == Some(frame) {
                data.truncate(100);
            }
            let depth = image(stamp_ns, "16UC1", 2, data);
            log.add(DEPTH, came_ns + 1, &depth);
            if self.with_clouds {
                log.add(CLOUDS, came_ns + 3, &cloud(info.clone(), depth.clone()));
            }
            if self.with_aligned {
                let (mut info, mut depth) = (info, depth);
                for header in [&mut info.header, &mut depth.header] {
                    COLOR_OPTICAL.clone_into(&mut header.frame_id);
                }
                log.add(ALIGNED_INFO, came_ns, &info);
                log.add(ALIGNED, came_ns + 1, &depth);
            }
        }
        if self.with_labels {
            // Of a network that is a second behind.
            let labels = pixels.iter().map(|(_, label)| *label).collect();
            let mut labels = image(stamp_ns + 3_000_000, "mono8", 1, labels);
            if self.with_aligned {
                COLOR_OPTICAL.clone_into(&mut labels.header.frame_id);
            }
            log.add(LABELS, came_ns + 1_000_000_000, &labels);
        }
        if self.with_colors {
            let places = (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (column, row)));
            let colors = places.zip(&pixels);
            let colors = colors.flat_map(|((column, row), (_, label))| color(column, row, *label));
            let colors = image(stamp_ns, "rgb8", 3, colors.collect());
            log.add(COLORS, came_ns + 2, &colors);
        }
    }
}
