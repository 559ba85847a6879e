//! The simulated house as files: the robot's map, headset clouds, and the truth.

use crate::evaluate::read_house;
use crate::labelled_ply::write_cloud;
use crate::simulate::house::{HeadsetTrial, LabelDraw, Scene, Survey, SurveyOptions};
use crate::{AnyError, at};
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::pose::Axes;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_core::voxels::label_names::write_named;
use lattice_nodes::files::atomic_write;
use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// File name of the robot's map.
pub const MAP_FILE: &str = "map.lattice";
/// File name of the class list.
pub const CLASSES_FILE: &str = "classes.yaml";

/// Axes of the headset's clouds.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeadsetAxes {
    /// x forward, y left, z up.
    #[default]
    Ros,
    /// x right, y up, z forward: left-handed.
    Unity,
}

/// Options of a simulated house.
#[derive(Clone, Debug)]
pub struct HouseOptions {
    /// Output folder.
    pub out: PathBuf,
    /// True to replace files of an earlier run.
    pub overwrite: bool,
    /// Mesh that replaces the built-in house, and the names of its classes.
    pub mesh: Option<(PathBuf, PathBuf)>,
    /// Pose of the house in the map.
    pub map_from_house: Isometry3<f64>,
    /// Seed of the simulation; equal seeds give equal bytes.
    pub seed: u64,
    /// Robot of the survey.
    pub survey: SurveyOptions,
    /// Pictures of each scene, 1 to 6.
    pub headset_scans: usize,
    /// Fraction of the headset's view with wrong labels, by regions, 0 to 1.
    pub flips: f64,
    /// Lattice of the map.
    pub lattice: LatticeKind,
    /// Cell size: edge of the cube of equal volume, m.
    pub cell_side_m: f64,
    /// Axes of the headset's clouds.
    pub axes: HeadsetAxes,
}

/// Summary of a written house.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct HouseSummary {
    /// Output folder.
    pub out: PathBuf,
    /// Number of triangles of the house.
    pub triangles: usize,
    /// Number of points of the robot's survey.
    pub survey_points: usize,
    /// Number of voxels of its map.
    pub voxels: usize,
    /// Number of points of each headset cloud, by file.
    pub headset_points: BTreeMap<String, usize>,
    /// Fraction of the headset's points in regions with different labels in headset and map.
    pub different_share: f64,
}

impl fmt::Display for HouseSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: house of {} triangles, map of {} voxels from {} points, labels of {:.0} % of the view differ",
            self.out.display(),
            self.triangles,
            self.voxels,
            self.survey_points,
            100.0 * self.different_share
        )?;
        let clouds = self.headset_points.iter();
        let clouds = clouds.map(|(name, points)| format!("{name} {points}"));
        let clouds: Vec<_> = clouds.collect();
        write!(f, "points: {}", clouds.join(", "))
    }
}

/// Ground truth of a scene, written beside its clouds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneTruth {
    /// Name of the scene.
    pub scene: String,
    /// Seed of the simulation.
    pub seed: u64,
    /// Axes of the clouds and of `sensor_m`; the ground truth always has ROS axes.
    pub axes: HeadsetAxes,
    /// Headset scans, all in one frame.
    pub headset_scans: Vec<HeadsetScanTruth>,
    /// True pose of the headset in the map.
    pub map_from_headset: Pose,
    /// Edge of a voxel of the headset's mesh, m.
    pub voxel_m: f64,
    /// Scale factor of the simulated distances from the headset; 1 is exact.
    pub scale: f64,
}

/// Cloud of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeadsetScanTruth {
    /// File name in the same folder.
    pub cloud: String,
    /// Position of the camera in the frame of the cloud, m.
    pub sensor_m: [f64; 3],
}

/// Rigid transform.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Translation, m.
    pub translation_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
}

impl From<Isometry3<f64>> for Pose {
    fn from(pose: Isometry3<f64>) -> Pose {
        Pose {
            translation_m: pose.translation.vector.into(),
            rotation_xyzw: pose.rotation.coords.into(),
        }
    }
}

/// Simulates a house and writes it to a folder: [`MAP_FILE`], [`CLASSES_FILE`], and for each scene
/// `NAME.ply` (further headset scans `NAME_2.ply` and so on) with `NAME.json`, a [`SceneTruth`], beside it.
/// `progress` is called with the share done, 0..1.
pub fn write_house(
    options: &HouseOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<HouseSummary, AnyError> {
    let lattice = Lattice::new(options.lattice, options.cell_side_m.powi(3))?;
    let (house, _) = read_house(options.mesh.as_ref(), options.seed)?;
    let house = house.placed(options.map_from_house);
    progress(0.1);
    fs::create_dir_all(&options.out).map_err(at(&options.out))?;
    let mut trials = Vec::new();
    for scene in Scene::ALL {
        let scans = options.headset_scans;
        trials.push(HeadsetTrial::new(&house, scene, scans, options.seed)?);
        progress(0.1 + 0.1 * trials.len() as f64);
    }
    let draw = LabelDraw::new(&house, &trials, options.flips, options.seed)?;
    let mut summary = HouseSummary {
        out: options.out.clone(),
        triangles: house.mesh().len(),
        different_share: draw.different_share,
        ..HouseSummary::default()
    };
    for trial in &trials {
        write_scene(options, trial, &draw, &mut summary)?;
    }
    let survey = Survey::new(&house, &options.survey, options.seed)?;
    progress(0.8);
    let list = survey.voxels(&lattice, &draw.map)?;
    summary.survey_points = survey.cloud.len();
    summary.voxels = list.len();
    let map = MapContents::from_list(&list);
    atomic_write::write(&place(options, MAP_FILE)?, |file| {
        write_named(&map, house.class_names(), file, &WriteOptions::default())
    })?;
    let classes = BTreeMap::from([("classes", house.class_names())]);
    let text = serde_yaml::to_string(&classes)?;
    atomic_write::write_text(&place(options, CLASSES_FILE)?, &text)?;
    progress(1.0);
    Ok(summary)
}

fn place(options: &HouseOptions, name: &str) -> Result<PathBuf, AnyError> {
    free_place(&options.out, name, options.overwrite)
}

/// Path of a new file in a folder.
///
/// # Errors
/// If the file exists and must not be replaced.
pub(super) fn free_place(folder: &Path, name: &str, overwrite: bool) -> Result<PathBuf, AnyError> {
    let path = folder.join(name);
    if path.exists() && !overwrite {
        let words = "there is a file already; choose another folder or allow to overwrite";
        return Err(at(&path)(words));
    }
    Ok(path)
}

fn write_scene(
    options: &HouseOptions,
    trial: &HeadsetTrial,
    draw: &LabelDraw,
    summary: &mut HouseSummary,
) -> Result<(), AnyError> {
    let name = trial.scene.name();
    let turned = |point_m: &Point3<f64>| match options.axes {
        HeadsetAxes::Ros => *point_m,
        HeadsetAxes::Unity => Axes::UnityRuf.from_ros(point_m.coords).into(),
    };
    let mut truth = SceneTruth {
        scene: name.to_owned(),
        seed: options.seed,
        axes: options.axes,
        headset_scans: Vec::new(),
        map_from_headset: trial.map_from_headset.into(),
        voxel_m: trial.voxel_m,
        scale: trial.scale,
    };
    for (number, headset_scan) in (1..).zip(&trial.headset_scans) {
        let cloud_name = match number {
            1 => format!("{name}.ply"),
            _ => format!("{name}_{number}.ply"),
        };
        let points: Vec<Point3<f64>> = headset_scan.points_m.iter().map(turned).collect();
        let cloud = draw.headset.cloud(&points, &headset_scan.regions);
        let path = place(options, &cloud_name)?;
        let comment = match options.axes {
            HeadsetAxes::Ros => "metres, headset_origin: x forward, y left, z up",
            HeadsetAxes::Unity => "metres, headset_origin: x right, y up, z forward (left-handed)",
        };
        write_cloud(&path, &points, |i| cloud.label(i), comment)?;
        let counts = &mut summary.headset_points;
        counts.insert(cloud_name.clone(), points.len());
        truth.headset_scans.push(HeadsetScanTruth {
            cloud: cloud_name,
            sensor_m: turned(&headset_scan.sensor_m).into(),
        });
    }
    let path = place(options, &format!("{name}.json"))?;
    atomic_write::write(&path, |file| serde_json::to_writer_pretty(file, &truth))
}
