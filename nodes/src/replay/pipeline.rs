//! The state machines of a replay, and the pass of a log through them.

use std::time::Instant;

use lattice_core::pose::StampedPose;
use lattice_core::raycast::FreeSpaceError;
use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};
use lattice_msgs::geographic_msgs::GeoPoint;
use lattice_msgs::geometry_msgs::{PoseStamped, PoseWithCovarianceStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{INSPVA, INSPVAX};
use lattice_msgs::sensor_msgs::{Imu, NavSatFix};
use lattice_msgs::tf2_msgs::TFMessage;

use super::depth_clouds::{DepthCloud, DepthClouds};
use super::report::{LatticeReport, RunReport};
use super::scan_poses::ScanPoses;
use super::slice::Slice;
use super::topic_plan::TopicPlan;
use super::topics::{Role, TopicError};
use crate::enu_transformer::ins::InsMessage;
use crate::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions, TransformerReport};
use crate::lattice_mapper::{LatticeMapper, MapperOptions, MapperReport};
use crate::lidar_odometry::LidarOdometryOptions;
use crate::voxel_marker_publisher::{MarkerOptions, MarkerReport, VoxelMarkers};
use lattice_bag::{BagMessage, BagReader, ReadOptions};
use lattice_runtime::params::Params;

/// Epoch of maps that come from a replay: the same log gives the same bytes.
const EPOCH: u64 = 1;
/// Poses and transforms behind a slice that its last clouds may wait for.
const POSES_BEHIND_NS: i64 = 10_000_000_000;
/// Labels and colours before a slice that its first depth images may be matched with.
const COMPANIONS_BEFORE_NS: i64 = 1_000_000_000;
/// Part of the progress that is of odometry, where poses come from it: it takes four fifths of the time.
const ODOMETRY_PART: f64 = 0.8;
/// Time between two updates of the map to its followers, in log time.
const UPDATE_PERIOD_NS: i64 = 1_000_000_000;

/// The machines of a replay: one transformer, any number of maps, with their markers if asked for.
pub struct Pipeline {
    pub(super) transformer: EnuTransformer,
    depth_clouds: Option<DepthClouds>,
    branches: Vec<Branch>,
    undecodable: u64,
    next_update_ns: Option<i64>,
    origin: Option<GeoPoint>,
}

struct Branch {
    mapper: LatticeMapper,
    markers: Option<VoxelMarkers>,
    published_bytes: u64,
}

impl Pipeline {
    /// Machines that have seen nothing.
    pub fn new(
        transformer: TransformerOptions,
        maps: impl IntoIterator<Item = MapperOptions>,
        markers: Option<&MarkerOptions>,
    ) -> Result<Self, FreeSpaceError> {
        let branch = |options| -> Result<Branch, FreeSpaceError> {
            Ok(Branch {
                mapper: LatticeMapper::new(options, EPOCH)?,
                markers: markers.cloned().map(VoxelMarkers::new),
                published_bytes: 0,
            })
        };
        Ok(Self {
            transformer: EnuTransformer::new(transformer),
            depth_clouds: None,
            branches: maps.into_iter().map(branch).collect::<Result<_, _>>()?,
            undecodable: 0,
            next_update_ns: None,
            origin: None,
        })
    }

    /// Sets the machines of depth cameras; by default they have the default parameters.
    pub fn set_depth_clouds(&mut self, depth_clouds: DepthClouds) {
        self.depth_clouds = Some(depth_clouds);
    }

    /// Passes one message of a topic of the log through all machines.
    pub fn on_message(&mut self, topic: &str, role: Role, message: &BagMessage) {
        match self.transform(topic, role, message) {
            Ok(outputs) => self.map(outputs),
            Err(error) => {
                self.undecodable += 1;
                self.transformer.on_undecodable(topic, &error);
            }
        }
        let now_ns = message.log_time_ns;
        let due_ns = *self.next_update_ns.get_or_insert(now_ns);
        if now_ns >= due_ns || now_ns < due_ns.saturating_sub(UPDATE_PERIOD_NS) {
            self.next_update_ns = Some(now_ns.saturating_add(UPDATE_PERIOD_NS));
            self.update();
        }
    }

    /// Adds static transforms before the first message.
    fn hold(&mut self, transforms: &TFMessage, now_ns: i64) {
        let outputs = self.transformer.on_tf(transforms, true, now_ns);
        self.map(outputs);
    }

    /// Ends the input and sums up.
    pub fn finish(&mut self) -> RunReport {
        let clouds = self.depth_clouds.as_mut().map(DepthClouds::finish);
        let outputs = self.transform_all(clouds.unwrap_or_default(), i64::MAX);
        self.map(outputs);
        let outputs = self.transformer.finish();
        self.map(outputs);
        self.update();
        let lattices = self.branches.iter_mut().map(Branch::finish).collect();
        RunReport {
            source: String::new(),
            clouds_in_log: self.transformer.counts().clouds_in,
            transformer: TransformerReport {
                counts: self.transformer.counts().clone(),
                undecodable: self.undecodable,
                refusals: self.transformer.refusals().all().to_vec(),
                notes: self.transformer.notes().to_vec(),
                attitude: self.transformer.attitude(),
                ..TransformerReport::default()
            },
            cameras: { self.depth_clouds.as_ref() }.map_or(Vec::new(), DepthClouds::reports),
            lattices,
            origin: self
                .origin
                .map(|at| [at.latitude, at.longitude, at.altitude]),
            odometry: None,
            implausible_rows: 0,
            cuts: Vec::new(),
            fit: Vec::new(),
            choices: Vec::new(),
            wall_s: 0.0,
        }
    }

    /// Handles poses of lidar odometry.
    fn on_scan_poses(&mut self, topic: &str, poses: &[Odometry], now_ns: i64) {
        for pose in poses {
            let outputs = (self.transformer).on_ins(topic, InsMessage::Odometry(pose), now_ns);
            self.map(outputs);
        }
    }

    /// The maps, in the order in which their options were given.
    pub fn mappers(&self) -> impl Iterator<Item = &LatticeMapper> {
        self.branches.iter().map(|branch| &branch.mapper)
    }

    /// Newest pose of the machine in the map.
    pub fn newest_pose(&self) -> Option<StampedPose> {
        self.transformer.newest_pose()
    }

    fn transform(
        &mut self,
        topic: &str,
        role: Role,
        message: &BagMessage,
    ) -> Result<Vec<EnuOutput>, CdrError> {
        let now_ns = message.log_time_ns;
        let data = &message.data;
        if let (Role::Camera(_), Some(cameras)) = (role, &mut self.depth_clouds) {
            let clouds = cameras.on_message(message.topic, data)?;
            return Ok(self.transform_all(clouds, now_ns));
        }
        let machine = &mut self.transformer;
        let mut ins = |message: InsMessage| machine.on_ins(topic, message, now_ns);
        Ok(match role {
            Role::Cloud(of) => match of.decode(data)?.into_cloud() {
                Ok(cloud) => machine.on_cloud(topic, cloud, now_ns),
                Err(error) => {
                    machine.on_unconverted(topic, &error);
                    Vec::new()
                }
            },
            Role::Transforms(is_static) => {
                machine.on_tf(&cdr::from_slice(data)?, is_static, now_ns)
            }
            Role::Ins(INSPVA::TYPE) => ins(InsMessage::Inspva(&cdr::from_slice(data)?)),
            Role::Ins(INSPVAX::TYPE) => ins(InsMessage::Inspvax(&cdr::from_slice(data)?)),
            Role::Ins(NavSatFix::TYPE) => ins(InsMessage::Fix(&cdr::from_slice(data)?)),
            Role::Ins(Imu::TYPE) => ins(InsMessage::Imu(&cdr::from_slice(data)?)),
            Role::Ins(PoseStamped::TYPE) => ins(InsMessage::Pose(&cdr::from_slice(data)?)),
            Role::Ins(PoseWithCovarianceStamped::TYPE) => {
                ins(InsMessage::PoseWithCovariance(&cdr::from_slice(data)?))
            }
            Role::Ins(Odometry::TYPE) => ins(InsMessage::Odometry(&cdr::from_slice(data)?)),
            Role::Imu => {
                // No pose or cloud depends on it.
                if let Ok(imu) = cdr::from_slice(data) {
                    machine.on_inertial(topic, &imu);
                }
                Vec::new()
            }
            Role::Ins(_) | Role::Camera(_) => Vec::new(),
        })
    }

    /// Passes clouds of depth cameras to the transformer.
    fn transform_all(&mut self, clouds: Vec<DepthCloud>, now_ns: i64) -> Vec<EnuOutput> {
        let clouds = clouds.into_iter();
        let outputs =
            clouds.flat_map(|(topic, cloud)| self.transformer.on_cloud(&topic, cloud, now_ns));
        outputs.collect()
    }

    fn map(&mut self, outputs: Vec<EnuOutput>) {
        for output in outputs {
            if let EnuOutput::Origin(origin) = &output {
                self.origin = Some(origin.position);
            }
            for branch in &mut self.branches {
                match &output {
                    EnuOutput::Points(points) => {
                        if let Err(refusal) = branch.mapper.on_cloud(points) {
                            log::warn!("{refusal}");
                        }
                    }
                    EnuOutput::Origin(origin) => branch.mapper.on_origin(origin),
                    EnuOutput::Transform(_) | EnuOutput::StaticTransform(_) => {}
                }
            }
        }
    }

    fn update(&mut self) {
        for branch in &mut self.branches {
            branch.update();
        }
    }
}

impl Branch {
    /// Passes changes of the map to the markers, as the nodes do by topics.
    fn update(&mut self) {
        let Some(markers) = &mut self.markers else {
            // Changes that nobody follows are not kept.
            self.mapper.take_update();
            return;
        };
        if markers.voxels() == 0 {
            for chunk in self.mapper.keyframe() {
                if let Err(error) = markers.on_map(&chunk) {
                    log::warn!("{error}");
                }
            }
        }
        for chunk in self.mapper.take_update() {
            if let Err(error) = markers.on_update(&chunk) {
                log::warn!("{error}");
            }
        }
        self.published_bytes += markers.take_bytes() as u64;
    }

    fn finish(&mut self) -> LatticeReport {
        let markers = self.markers.as_mut().map(|markers| {
            let report = MarkerReport {
                counts: markers.counts().clone(),
                voxels: markers.voxels(),
                published_bytes: self.published_bytes,
                ..MarkerReport::default()
            };
            markers.wipe();
            MarkerReport {
                marker_bytes: markers.take_bytes(),
                ..report
            }
        });
        LatticeReport {
            map: MapperReport::of(&self.mapper),
            markers,
        }
    }
}

/// Replays the clouds of a slice of a log, with the poses and transforms of before and shortly after.
///
/// `progress` gets the part that has passed, from 0 to 1. Slices that share no time and leave none out
/// have together the clouds of the log, each transformed as in one replay of it all.
pub fn run(
    bag: &BagReader,
    plan: &TopicPlan,
    slice: &Slice,
    pipeline: &mut Pipeline,
    source: &str,
    progress: &mut dyn FnMut(f64),
) -> Result<RunReport, TopicError> {
    let begin = Instant::now();
    let start_ns = bag.start_ns().unwrap_or(0);
    let (from_ns, to_ns) = slice.range_ns(start_ns)?;
    let end_ns = bag.end_ns().unwrap_or(0).min(to_ns);
    let span_ns = end_ns.saturating_sub(start_ns).max(1) as f64;
    let whole = *slice == Slice::WHOLE;
    let before = ReadOptions {
        topics: Some(plan.names(bag, |role| !role.is_cloud())),
        end_ns: Some(from_ns),
        ..ReadOptions::default()
    };
    let within = ReadOptions {
        topics: Some(plan.names(bag, |_| true)),
        start_ns: (!whole).then_some(from_ns),
        end_ns: (!whole).then_some(to_ns.saturating_add(POSES_BEHIND_NS)),
        ..ReadOptions::default()
    };
    pipeline.transformer.expect_delay(plan.pose_delay_ns);
    if pipeline.depth_clouds.is_none() && !plan.cameras.is_empty() {
        let params = Params::from_values::<String>("/semantic_cloud", []);
        pipeline.set_depth_clouds(DepthClouds::new(bag, plan, &params)?);
    }
    let mut clouds = 0;
    if !plan.late_statics.transforms.is_empty() {
        pipeline.hold(&plan.late_statics, start_ns);
    }
    let tell = &mut |log_time_ns: i64, from: f64, to: f64| {
        let part = log_time_ns.saturating_sub(start_ns) as f64 / span_ns;
        progress(from + (to - from) * part.clamp(0.0, 1.0));
    };
    let mut odometry = match plan.odometry {
        Some(topic) => {
            let options = LidarOdometryOptions::of(pipeline.transformer.options());
            let told = &mut |log_time_ns| tell(log_time_ns, 0.0, ODOMETRY_PART);
            // The whole log for any slice, so that all have the same loops.
            Some(ScanPoses::of(bag, plan, topic, options, told)?)
        }
        None => None,
    };
    let mapping_from = odometry.as_ref().map_or(0.0, |_| ODOMETRY_PART);
    let passes = [(!whole).then_some(before), Some(within)];
    for options in passes.into_iter().flatten() {
        for message in bag.messages(&options)? {
            let message = message?;
            let role = plan.roles.get(&message.topic).copied();
            let is_cloud = role.is_some_and(Role::is_cloud);
            let behind = is_cloud && message.log_time_ns >= to_ns;
            let is_early = message.log_time_ns < from_ns.saturating_sub(COMPANIONS_BEFORE_NS);
            let is_left_out = behind || is_early && role.is_some_and(Role::is_companion);
            if let Some(role) = role.filter(|_| !is_left_out) {
                clouds += u64::from(is_cloud);
                let topic = bag.topics().get(message.topic);
                let topic = topic.map_or("", |topic| topic.name.as_str());
                let of_scans = odometry
                    .as_mut()
                    .filter(|scans| scans.topic == message.topic);
                if let Some(scans) = of_scans {
                    let Some(poses) = scans.poses(message.log_time_ns) else {
                        continue;
                    };
                    pipeline.on_scan_poses(topic, &poses, message.log_time_ns);
                }
                pipeline.on_message(topic, role, &message);
            }
            tell(message.log_time_ns, mapping_from, 1.0);
        }
    }
    Ok(RunReport {
        source: source.to_owned(),
        clouds_in_log: if whole { plan.clouds(bag) } else { clouds },
        implausible_rows: bag.implausible_rows(),
        cuts: bag.cuts(),
        choices: plan.choices.clone(),
        odometry: odometry.map(|scans| scans.report),
        wall_s: begin.elapsed().as_secs_f64(),
        ..pipeline.finish()
    })
}
