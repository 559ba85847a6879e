//! A floor, a wall and a panel before it, as a depth camera and a segmenter see them.

use lattice_msgs::sensor_msgs::{CameraInfo, Image, PointCloud2};
use lattice_nodes::convert::cloud::layout_of;
use lattice_nodes::semantic_cloud::Camera;
use lattice_test::clouds::header;
use nalgebra::Vector3;
use serde_bytes::ByteBuf;

pub const WIDTH: u32 = 160;
pub const HEIGHT: u32 = 120;
/// Planes as n, d with n p + d = 0, in the optical frame; their labels are their places.
const PLANES: [[f64; 4]; 4] = [
    [0.0; 4],
    [0.0, 1.0, 0.0, -1.0],
    [0.2, 0.0, 1.0, -5.0],
    [0.0, 0.0, 1.0, -2.0],
];
/// The panel reaches this far from the axis, m.
const PANEL_M: [f64; 2] = [0.5, 0.4];

/// A camera of 160 x 120 pixels with a model and its parameters.
pub fn camera_info(model: &str, d: &[f64]) -> CameraInfo {
    let (f, cx, cy) = (140.0, 79.3, 60.8);
    CameraInfo {
        header: header("camera", 0),
        height: HEIGHT,
        width: WIDTH,
        distortion_model: model.to_owned(),
        d: d.to_vec(),
        k: [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
        p: [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}

/// Depth and label of what a ray (x / z, y / z) hits.
fn look([x, y]: [f64; 2]) -> (f64, u16) {
    let at = |class: u16| {
        let [a, b, c, d] = PLANES[usize::from(class)];
        (-d / (a * x + b * y + c), class)
    };
    let is_panel = (2.0 * x).abs() < PANEL_M[0] && (2.0 * y).abs() < PANEL_M[1];
    let floor = (y > 0.0).then(|| at(1));
    let all = [Some(at(2)), floor, is_panel.then(|| at(3))];
    let hits = all.into_iter().flatten();
    hits.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

/// Writing of an image.
#[derive(Clone, Copy, Debug)]
pub struct Form {
    pub encoding: &'static str,
    pub is_bigendian: bool,
    /// Bytes behind each row.
    pub padding: usize,
}

impl Form {
    pub fn plain(encoding: &'static str) -> Self {
        Self {
            encoding,
            is_bigendian: false,
            padding: 0,
        }
    }

    /// An image of numbers, row by row.
    pub fn image(self, stamp_ns: i64, width: u32, numbers: &[f64]) -> Image {
        let mut data = Vec::new();
        for row in numbers.chunks(width as usize) {
            for &number in row {
                let mut bytes = match self.encoding {
                    "mono8" | "8UC1" => vec![number as u8],
                    "mono16" | "16UC1" => (number as u16).to_le_bytes().to_vec(),
                    "32SC1" => (number as i32).to_le_bytes().to_vec(),
                    _ => (number as f32).to_le_bytes().to_vec(),
                };
                if self.is_bigendian {
                    bytes.reverse();
                }
                data.extend(bytes);
            }
            data.extend(vec![0xA5; self.padding]);
        }
        let height = numbers.len() as u32 / width;
        Image {
            header: header("camera", stamp_ns),
            height,
            width,
            encoding: self.encoding.to_owned(),
            is_bigendian: self.is_bigendian.into(),
            step: data.len() as u32 / height,
            data: ByteBuf::from(data),
        }
    }
}

/// Depth and label at a pixel of an image `shrink` times smaller than the camera's own.
fn seen_at(camera: &Camera, shrink: u32, (column, row): (u32, u32)) -> (f64, u16) {
    let place = |i: u32| f64::from(i * shrink) + 0.5 * f64::from(shrink - 1);
    look(camera.ray(place(column), place(row)).unwrap())
}

fn seen(camera: &Camera, shrink: u32) -> Vec<(f64, u16)> {
    let pixels = (0..HEIGHT / shrink).flat_map(|row| (0..WIDTH / shrink).map(move |c| (c, row)));
    pixels.map(|pixel| seen_at(camera, shrink, pixel)).collect()
}

pub fn depth(camera: &Camera, stamp_ns: i64, form: Form) -> Image {
    let unit = if form.encoding == "16UC1" { 1e3 } else { 1.0 };
    let depths: Vec<f64> = seen(camera, 1).iter().map(|(z, _)| z * unit).collect();
    let depths: Vec<f64> = match form.encoding {
        "16UC1" => depths.iter().map(|mm| mm.round()).collect(),
        _ => depths,
    };
    form.image(stamp_ns, WIDTH, &depths)
}

pub fn labels(camera: &Camera, stamp_ns: i64, shrink: u32, form: Form) -> Image {
    let labels = seen(camera, shrink);
    let labels: Vec<f64> = labels.iter().map(|(_, label)| f64::from(*label)).collect();
    form.image(stamp_ns, WIDTH / shrink, &labels)
}

/// A point of a cloud.
pub struct Point {
    pub place_m: Vector3<f64>,
    pub label: u16,
    pub confidence: f64,
}

impl Point {
    /// Distance from what is there at the pixel that shows it, m, and the label that an image `shrink` times
    /// smaller has there.
    pub fn truth(&self, camera: &Camera, shrink: u32) -> (f64, u16) {
        let pixel = camera.project(self.place_m.into()).map(f64::round);
        let ray = camera.ray(pixel[0], pixel[1]).unwrap();
        let (z_m, _) = look(ray);
        let there_m = Vector3::new(ray[0], ray[1], 1.0) * z_m;
        let [column, row] = pixel.map(|v| v as u32 / shrink);
        let (_, label) = seen_at(camera, shrink, (column, row));
        ((self.place_m - there_m).norm(), label)
    }
}

pub fn points(cloud: &PointCloud2) -> Vec<Point> {
    let layout = layout_of(cloud);
    let limits = lattice_core::cloud::CloudLimits {
        max_points: 100_000,
    };
    let view = layout.view(&cloud.data, &limits).unwrap();
    let field = |name: &str| view.fields().iter().find(|f| f.name == name).unwrap();
    let (label, confidence) = (field("label"), field("confidence"));
    let point = |i| Point {
        place_m: view.xyz(i),
        label: view.scalar(label, i) as u16,
        confidence: view.scalar(confidence, i),
    };
    (0..view.len()).map(point).collect()
}
