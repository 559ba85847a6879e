//! Images of simulated houses as files: colours, labels, depth, cameras and poses, for training networks.

use super::house::{Pose, free_place};
use crate::evaluate::read_house;
use crate::options::within;
use crate::simulate::house::{House, RoomCamera, RoomImage, RoomImages, look_views, robot_views};
use crate::{AnyError, at};
use lattice_core::registration::UNLABELED;
use lattice_nodes::files::atomic_write;
use nalgebra::Isometry3;
use png::{BitDepth, ColorType};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fmt, fs};

/// Name of the list of images in the folder.
pub const IMAGES_FILE: &str = "images.json";
/// Label of pixels without a class in the files.
const NONE: u8 = u8::MAX;
/// Most images of a folder.
const MAX_IMAGES: f64 = 1e6;

/// Camera of a set of images.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ImageCamera {
    /// The robot's, on its walk.
    Robot,
    /// Camera poses of a headset that views objects.
    Headset,
}

/// Houses of a set of images.
#[derive(Clone, PartialEq, Debug)]
pub enum ImageHouses {
    /// Generated house, drawn anew for every `per_house` images, see [`House::drawn`].
    Drawn,
    /// Generated house with fixed rooms, see [`House::generated`], and new clutter and materials for every
    /// `per_house` images.
    Generated,
    /// Mesh and the names of its classes, with new materials for every `per_house` images.
    Mesh(PathBuf, PathBuf),
}

/// Options of a set of images.
#[derive(Clone, Debug)]
pub struct ImagesOptions {
    /// The folder.
    pub out: PathBuf,
    /// True to replace files of an earlier run.
    pub overwrite: bool,
    /// Houses that are seen.
    pub houses: ImageHouses,
    /// Number of images of one house and its materials.
    pub per_house: usize,
    /// Images.
    pub count: usize,
    /// Camera that they are of.
    pub camera: ImageCamera,
    /// Pixels in a row and rows; of the camera itself if None.
    pub size: Option<[usize; 2]>,
    /// The same seed gives the same bytes.
    pub seed: u64,
}

/// One image of a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageEntry {
    /// File of its colours, 8-bit RGB.
    pub color: String,
    /// File of its true labels, 8 bits; 255 is none.
    pub labels: String,
    /// File of its true depth along the camera's axis, 16 bits, mm; 0 where nothing is within 65 m.
    pub depth: String,
    /// Seed of the house and its materials.
    pub house_seed: u64,
    /// Pose of the camera: x forward, y left, z up.
    pub house_from_camera: Pose,
}

/// List of a set: [`IMAGES_FILE`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageSet {
    /// The camera.
    pub camera: ImageCamera,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Camera matrix, row-major, pixels; there is no distortion.
    pub k: [f64; 9],
    /// Names of the classes.
    pub classes: BTreeMap<u16, String>,
    /// The images.
    pub images: Vec<ImageEntry>,
}

/// Summary of a written set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImagesSummary {
    /// The folder.
    pub out: PathBuf,
    /// Images in it.
    pub images: usize,
    /// Number of houses, each with its materials.
    pub houses: usize,
    /// Pixels of each class, by name, share of all.
    pub shares: BTreeMap<String, f64>,
}

impl fmt::Display for ImagesSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            out,
            images,
            houses,
            ..
        } = self;
        writeln!(f, "{}: {images} images of {houses} houses", out.display())?;
        let shares = self.shares.iter();
        let shares = shares.map(|(name, share)| format!("{name} {:.1} %", 100.0 * share));
        write!(f, "{}", shares.collect::<Vec<_>>().join(", "))
    }
}

/// Renders images and writes them to a folder. `progress` is called with the share done, 0..1.
pub fn write_images(
    options: &ImagesOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<ImagesSummary, AnyError> {
    within("count", options.count as f64, 1.0, MAX_IMAGES)?;
    within("per-house", options.per_house as f64, 1.0, 2e4)?;
    let camera = camera(options)?;
    let list = free_place(&options.out, IMAGES_FILE, options.overwrite)?;
    fs::create_dir_all(&options.out).map_err(at(&options.out))?;
    let mut set = ImageSet {
        camera: options.camera,
        width: camera.width,
        height: camera.height,
        k: camera.camera_info("", 0).k,
        classes: BTreeMap::new(),
        images: Vec::with_capacity(options.count),
    };
    let mut pixels: BTreeMap<u8, u64> = BTreeMap::new();
    let mut mesh_house = None;
    let houses = options.count.div_ceil(options.per_house);
    for number in 0..houses {
        let seed = options.seed.wrapping_add(number as u64);
        let first = number * options.per_house;
        let views = options.per_house.min(options.count - first);
        let drawn;
        let house = match &options.houses {
            ImageHouses::Drawn => {
                drawn = House::drawn(seed)?;
                &drawn
            }
            ImageHouses::Generated => {
                drawn = House::generated(seed)?;
                &drawn
            }
            ImageHouses::Mesh(mesh, classes) => match &mesh_house {
                Some(house) => house,
                None => {
                    let files = (mesh.clone(), classes.clone());
                    &*mesh_house.insert(read_house(Some(&files), 0)?.0)
                }
            },
        };
        set.classes.clone_from(house.class_names());
        let rooms = RoomImages::new(house, seed);
        for (view, pose) in poses(options.camera, house, views, seed)?
            .iter()
            .enumerate()
        {
            let at = first + view;
            let image = rooms.take(&camera, pose, at as u64 ^ options.seed.rotate_left(32));
            let labels = labels(&image)?;
            labels
                .iter()
                .for_each(|label| *pixels.entry(*label).or_default() += 1);
            set.images
                .push(write_image(options, at, &image, &labels, seed, pose)?);
            progress((at + 1) as f64 / options.count as f64);
        }
    }
    atomic_write::write(&list, |file| serde_json::to_writer_pretty(file, &set))?;
    let all = pixels.values().sum::<u64>().max(1) as f64;
    let name = |label: u8| {
        set.classes
            .get(&label.into())
            .map_or("none", String::as_str)
    };
    Ok(ImagesSummary {
        out: options.out.clone(),
        images: set.images.len(),
        houses,
        shares: pixels
            .iter()
            .map(|(l, n)| (name(*l).to_owned(), *n as f64 / all))
            .collect(),
    })
}

fn camera(options: &ImagesOptions) -> Result<RoomCamera, AnyError> {
    let camera = match options.camera {
        ImageCamera::Robot => RoomCamera::ROBOT,
        ImageCamera::Headset => RoomCamera::HEADSET,
    };
    let Some([width, height]) = options.size else {
        return Ok(camera);
    };
    within("width", width as f64, 1.0, 8192.0)?;
    within("height", height as f64, 1.0, 8192.0)?;
    Ok(camera.sized(width, height))
}

fn poses(
    camera: ImageCamera,
    house: &House,
    views: usize,
    seed: u64,
) -> Result<Vec<Isometry3<f64>>, AnyError> {
    match camera {
        ImageCamera::Robot => {
            let views = robot_views(house, views, seed)?;
            Ok(views.iter().map(|view| view.truth).collect())
        }
        ImageCamera::Headset => look_views(house, views, seed),
    }
}

fn labels(image: &RoomImage) -> Result<Vec<u8>, AnyError> {
    let byte = |&label: &u16| match label {
        UNLABELED => Ok(NONE),
        _ => match u8::try_from(label) {
            Ok(label) if label != NONE => Ok(label),
            _ => Err(format!("class {label}: files of labels hold 0 to 254").into()),
        },
    };
    image.labels.iter().map(byte).collect()
}

fn write_image(
    options: &ImagesOptions,
    number: usize,
    image: &RoomImage,
    labels: &[u8],
    house_seed: u64,
    pose: &Isometry3<f64>,
) -> Result<ImageEntry, AnyError> {
    let name = |what: &str| format!("{number:06}_{what}.png");
    let depth = image.depth_m.iter().map(|depth_m| {
        let mm = (depth_m * 1e3).round();
        if mm <= f32::from(u16::MAX) {
            mm as u16
        } else {
            0
        }
    });
    let depth: Vec<u8> = depth.flat_map(u16::to_be_bytes).collect();
    let size = [image.width as u32, image.height as u32];
    for (what, kind, bits, data) in [
        (
            "color",
            ColorType::Rgb,
            BitDepth::Eight,
            image.rgb.as_slice(),
        ),
        ("labels", ColorType::Grayscale, BitDepth::Eight, labels),
        (
            "depth",
            ColorType::Grayscale,
            BitDepth::Sixteen,
            depth.as_slice(),
        ),
    ] {
        let path = free_place(&options.out, &name(what), options.overwrite)?;
        write_png(&path, size, kind, bits, data)?;
    }
    Ok(ImageEntry {
        color: name("color"),
        labels: name("labels"),
        depth: name("depth"),
        house_seed,
        house_from_camera: (*pose).into(),
    })
}

fn write_png(
    path: &Path,
    [width, height]: [u32; 2],
    kind: ColorType,
    bits: BitDepth,
    data: &[u8],
) -> Result<(), AnyError> {
    atomic_write::write(path, |file| -> Result<(), png::EncodingError> {
        let mut encoder = png::Encoder::new(file, width, height);
        encoder.set_color(kind);
        encoder.set_depth(bits);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(data)?;
        writer.finish()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_three_files_for_each_image_and_the_same_bytes_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let options = |name: &str, camera| ImagesOptions {
            out: folder.path().join(name),
            overwrite: false,
            houses: ImageHouses::Drawn,
            per_house: 2,
            count: 3,
            camera,
            size: Some([32, 24]),
            seed: 5,
        };
        let robot = options("robot", ImageCamera::Robot);
        let summary = write_images(&robot, &mut |_| ()).unwrap();
        assert_eq!((summary.images, summary.houses), (3, 2));
        assert!((summary.shares.values().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(
            write_images(&robot, &mut |_| ()).is_err(),
            "there is one already"
        );
        let again = options("again", ImageCamera::Robot);
        write_images(&again, &mut |_| ()).unwrap();
        let text = fs::read_to_string(robot.out.join(IMAGES_FILE)).unwrap();
        let set: ImageSet = serde_json::from_str(&text).unwrap();
        for image in &set.images {
            for file in [&image.color, &image.labels, &image.depth] {
                let [a, b] = [&robot, &again].map(|o| fs::read(o.out.join(file)).unwrap());
                assert!(a == b && a.len() > 60, "{file}");
            }
        }
        let headset = options("headset", ImageCamera::Headset);
        write_images(&headset, &mut |_| ()).unwrap();
        let wide = ImagesOptions {
            size: Some([0, 24]),
            ..options("none", ImageCamera::Robot)
        };
        assert!(write_images(&wide, &mut |_| ()).is_err());
    }
}
