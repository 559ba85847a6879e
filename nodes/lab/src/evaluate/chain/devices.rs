//! Robot and headset from images to labelled points, each by the machines of its nodes.

use std::sync::{Arc, Mutex, PoisonError};

use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::registration::{LabelDistribution, SemanticCloud, SourceCloud, UNLABELED};
use lattice_core::voxels::{Payload, VoxelList};
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::{Image, PointCloud2};
use lattice_nodes::convert::geometry::{header, pose_from};
use lattice_nodes::convert::headset_mesh::{chunks_for, in_chunks};
use lattice_nodes::convert::semantic::{SemanticOptions, headset_scan_from_message};
use lattice_nodes::headset_cloud::{HeadsetCloud, HeadsetOptions, HeadsetOutput, HeadsetStream};
use lattice_nodes::segmenter::{Labelled, Segmenter};
use lattice_nodes::semantic_cloud::{
    CloudOptions, CloudOutput, SemanticCloud as DepthCloud, Stream,
};
use lattice_runtime::params::Params;
use nalgebra::{Isometry3, Point3};

use crate::AnyError;
use crate::random::seed_of;
use crate::simulate::house::{
    HeadsetTrial, House, HouseScan, RoomCamera, RoomImage, RoomImages, robot_views,
};

/// Frames of the messages.
const CAMERA: &str = "camera";
const HEADSET: &str = "headset_origin";
/// Time between images, ns.
const PERIOD_NS: i64 = 1_000_000_000;
/// Step of the columns and rows of a depth image that become points.
const STRIDE: usize = 2;

/// Result with the labels of the network, and the same with true labels.
pub(super) struct Both<T> {
    pub found: T,
    pub truth: T,
}

/// The robot's map: points in the map frame from posed depth images and labels of their colours.
pub(super) fn robot_map(
    rooms: &RoomImages,
    segmenter: &Mutex<Segmenter>,
    lattice: &Lattice,
    views: usize,
    seed: u64,
) -> Result<Both<SemanticCloud>, AnyError> {
    let house = rooms.house();
    let mut found = Mapper::new(house, lattice)?;
    let mut truth = Mapper::new(house, lattice)?;
    for (view, number) in robot_views(house, views, seed)?.iter().zip(0_u64..) {
        let stamp_ns = number as i64 * PERIOD_NS;
        let image = rooms.take(&RoomCamera::ROBOT, &view.truth, seed_of(&[seed, number, 1]));
        let depth = image.measured_depth_m(seed_of(&[seed, number, 2]));
        let depth = Arc::new(image.depth_message(header(CAMERA, stamp_ns), &depth));
        let labels = labelled(segmenter, &image, stamp_ns)?.labels;
        let map_from_camera = house.map_from_house() * view.measured;
        found.add(&depth, labels, &map_from_camera)?;
        let true_labels = image.labels_message(header(CAMERA, stamp_ns));
        truth.add(&depth, true_labels, &map_from_camera)?;
    }
    Ok(Both {
        found: found.map(),
        truth: truth.map(),
    })
}

/// `semantic_cloud`, and the voxels of its points.
struct Mapper {
    machine: DepthCloud,
    list: VoxelList,
}

impl Mapper {
    fn new(house: &House, lattice: &Lattice) -> Result<Mapper, AnyError> {
        let mut options = CloudOptions::default();
        options.points.stride = STRIDE;
        let mut machine = DepthCloud::new(options);
        machine.on_camera_info(Arc::new(RoomCamera::ROBOT.camera_info(CAMERA, 0)));
        let payload = Payload {
            labels: true,
            ..Payload::default()
        };
        let datum_m = house.map_from_house().translation.vector;
        let list = VoxelList::new(lattice.clone(), datum_m, usize::MAX)?;
        Ok(Mapper {
            machine,
            list: list.with_payload(payload),
        })
    }

    fn add(
        &mut self,
        depth: &Arc<Image>,
        labels: Image,
        map_from_camera: &Isometry3<f64>,
    ) -> Result<(), AnyError> {
        let mut outputs = self.machine.on_image(Stream::Depth, Arc::clone(depth));
        outputs.extend(self.machine.on_image(Stream::Labels, Arc::new(labels)));
        let mut clouds = outputs.iter().filter_map(|output| match output {
            CloudOutput::Points(cloud) => Some(cloud),
            _ => None,
        });
        let cloud = clouds.next().ok_or_else(|| {
            let problem = self.machine.problem().unwrap_or("no partner");
            format!("semantic_cloud made no points: {problem}")
        })?;
        let Some(SourceCloud { cloud, .. }) = points(cloud)? else {
            // A wall too near to be seen.
            return Ok(());
        };
        let map_from_optical = map_from_camera * RoomCamera::camera_from_optical();
        let in_map = cloud.points_m.iter().map(|p| (map_from_optical * p).coords);
        let in_map: Vec<_> = in_map.collect();
        let labels = cloud
            .labels
            .iter()
            .map(|label| label.top().unwrap_or(UNLABELED));
        let labels: Vec<u16> = labels.collect();
        let cloud = Cloud::from_points(0, self.list.datum_m(), &in_map);
        self.list.insert_labelled(&cloud, &labels);
        Ok(())
    }

    fn map(&self) -> SemanticCloud {
        SemanticCloud::from_voxels(&self.list)
    }
}

/// Pose of the headset's frame in the house.
pub(super) fn house_from_headset(rooms: &RoomImages, trial: &HeadsetTrial) -> Isometry3<f64> {
    rooms.house().map_from_house().inverse() * trial.map_from_headset
}

/// The headset's own mesh as it sends it.
pub(super) fn headset_mesh(rooms: &RoomImages, trial: &HeadsetTrial) -> Vec<Arc<HeadsetMesh>> {
    let mesh = trial.mesh_message(rooms.house(), header(HEADSET, PERIOD_NS), "");
    let chunks = in_chunks(&mesh, chunks_for(&mesh));
    chunks.into_iter().map(Arc::new).collect()
}

/// The headset's points of one picture: `headset_cloud` on its own mesh and on labels of its image; none if the
/// picture shows nothing that the headset has a mesh of.
pub(super) fn headset_scan(
    image: &RoomImage,
    segmenter: &Mutex<Segmenter>,
    chunks: &[Arc<HeadsetMesh>],
    scan: &HouseScan,
) -> Result<Option<Both<SourceCloud>>, AnyError> {
    let found = labelled(segmenter, image, PERIOD_NS)?;
    let found = look(chunks, scan, found.labels, found.confidence)?;
    let true_labels = image.labels_message(header(CAMERA, PERIOD_NS));
    let truth = look(chunks, scan, true_labels, None)?;
    let both = found.zip(truth);
    Ok(both.map(|(found, truth)| Both { found, truth }))
}

fn look(
    chunks: &[Arc<HeadsetMesh>],
    scan: &HouseScan,
    labels: Image,
    confidence: Option<Image>,
) -> Result<Option<SourceCloud>, AnyError> {
    let mut options = HeadsetOptions::from_params(&Params::default())?;
    options.look.stride = 1;
    options.use_confidence = confidence.is_some();
    let mut machine = HeadsetCloud::new(options);
    for chunk in chunks {
        machine.on_mesh(chunk);
    }
    let [width, height] = HouseScan::PIXELS;
    let camera = RoomCamera::HEADSET.sized(width, height);
    machine.on_camera_info(Arc::new(camera.camera_info(CAMERA, 0)));
    let pose = scan.headset_from_camera * RoomCamera::camera_from_optical();
    machine.on_pose(&PoseStamped {
        header: header(HEADSET, PERIOD_NS),
        pose: pose_from(&pose),
    });
    let mut outputs = machine.on_image(HeadsetStream::Labels, Arc::new(labels));
    if let Some(confidence) = confidence {
        outputs.extend(machine.on_image(HeadsetStream::Confidence, Arc::new(confidence)));
    }
    let mut clouds = outputs.iter().filter_map(|output| match output {
        HeadsetOutput::Points(cloud) => Some(cloud),
        _ => None,
    });
    let cloud = clouds.next().map(points).transpose()?.flatten();
    let sees_nothing = machine.counts().dropped.contains_key("labels_sees_no_mesh");
    if cloud.is_none() && !sees_nothing {
        let problem = machine.problem().unwrap_or("no partner");
        return Err(format!("headset_cloud made no points: {problem}").into());
    }
    Ok(cloud)
}

/// Points, labels and viewpoint of a cloud as `semantic_icp_server` reads them; none of an empty one.
fn points(cloud: &PointCloud2) -> Result<Option<SourceCloud>, AnyError> {
    if cloud.width == 0 || cloud.height == 0 {
        return Ok(None);
    }
    let (mut scan, _) = headset_scan_from_message(cloud, &SemanticOptions::default())?;
    if scan.cloud.labels.is_empty() {
        scan.cloud.labels = vec![LabelDistribution::UNKNOWN; scan.cloud.points_m.len()];
    }
    Ok(Some(scan))
}

fn labelled(
    segmenter: &Mutex<Segmenter>,
    image: &RoomImage,
    stamp_ns: i64,
) -> Result<Labelled, AnyError> {
    let message = image.colors_message(header(CAMERA, stamp_ns));
    // A thread that panicked left no image half done.
    let mut segmenter = segmenter.lock().unwrap_or_else(PoisonError::into_inner);
    let found = segmenter.on_image(&message);
    Ok(found.ok_or_else(|| {
        let problem = segmenter.problem().unwrap_or_default();
        format!("the segmenter refused an image: {problem}")
    })?)
}

/// Share of points whose most probable label is the true one, of those that truly have one.
pub(super) fn right_share(found: &SemanticCloud, truth: &SemanticCloud) -> Result<f64, AnyError> {
    if found.points_m != truth.points_m {
        let (found, truth) = (found.points_m.len(), truth.points_m.len());
        let problem = format!(
            "{found} points with labels of the network, expected the same {truth} as with true labels"
        );
        return Err(problem.into());
    }
    let pairs = found.labels.iter().zip(&truth.labels);
    let known = pairs.filter(|(_, truth)| truth.top().is_some());
    let (mut right, mut all) = (0_u64, 0_u64);
    for (found, truth) in known {
        all += 1;
        right += u64::from(found.top() == truth.top());
    }
    Ok(right as f64 / all.max(1) as f64)
}

/// The points and labels of all scans.
pub(super) fn together(scans: &[SourceCloud]) -> SemanticCloud {
    let clouds = || scans.iter().map(|scan| &scan.cloud);
    SemanticCloud {
        points_m: clouds()
            .flat_map(|cloud| cloud.points_m.iter().copied())
            .collect(),
        labels: clouds()
            .flat_map(|cloud| cloud.labels.iter().cloned())
            .collect(),
    }
}

/// Cloud without its labels.
pub(super) fn unlabelled(cloud: &SemanticCloud) -> SemanticCloud {
    SemanticCloud {
        points_m: cloud.points_m.clone(),
        labels: Vec::new(),
    }
}

/// Middle of a cloud.
pub(super) fn middle_m(cloud: &SemanticCloud) -> Point3<f64> {
    let sum = cloud
        .points_m
        .iter()
        .map(|p| p.coords)
        .sum::<nalgebra::Vector3<f64>>();
    (sum / cloud.points_m.len().max(1) as f64).into()
}
