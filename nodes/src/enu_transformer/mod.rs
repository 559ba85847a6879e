//! From sensor clouds and an INS to clouds in the map frame (east, north, up).
//!
//! [`EnuTransformer`] is a state machine without I/O; [`node`] runs it behind DDS.

mod counts;
pub mod ins;
pub mod node;
mod options;
mod parameters;
mod transforms;
mod waiting;

pub use counts::{TransformerCounts, TransformerReport};
pub use options::TransformerOptions;
pub use parameters::declare;

use std::sync::Arc;

use lattice_core::cloud::{CloudLimits, RangeLimits, transform_points};
use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose, TfMiss, TransformBuffer,
    TransformBufferOptions,
};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::geographic_msgs::GeoPointStamped;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::sensor_msgs::PointCloud2;
use nalgebra::{Isometry3, Vector3};

use self::ins::{InsDecoder, InsMessage, InsRefusal, InsSource};
use self::waiting::{Waiting, WaitingCloud};
use crate::convert::{cloud, viewpoint};
use crate::stamps::StampGate;

/// A step back of the receiving clock by more than this is a log that loops.
const CLOCK_JUMP_NS: i64 = 1_000_000_000;
/// Poses in a row that agree on another time before it is believed.
const AGREEING_POSES: u32 = 3;

/// Output of the transformer.
#[derive(Clone, Debug)]
pub enum EnuOutput {
    /// For `points_enu`.
    Points(Arc<PointCloud2>),
    /// For `/tf`.
    Transform(TransformStamped),
    /// For `/tf_static`: `earth` -> `map`.
    StaticTransform(TransformStamped),
    /// For `map_origin`.
    Origin(GeoPointStamped),
}

/// Reason for which a cloud was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Drop {
    Malformed,
    BeforePoses,
    PoseGap,
    PoseLate,
    NoMount,
    TimeJump,
}

/// Treatment of a cloud at this time.
enum Verdict {
    Transform,
    Wait,
    Drop(Drop),
}

/// Moves clouds of any number of sensors into the map frame, each point at its own time.
///
/// Clouds wait in a bounded queue until poses and mounts cover all of their points; nothing is
/// extrapolated. Every input comes with the time at which it was received (`now_ns`): the clock
/// of the node, or the log's own time.
pub struct EnuTransformer {
    options: TransformerOptions,
    ins: InsDecoder,
    poses: PoseBuffer,
    stamps: StampGate,
    mounts: TransformBuffer,
    waiting: Waiting,
    announced: bool,
    /// Stamp of the newest `map` -> `odom_frame`.
    odom_ns: Option<i64>,
    last_now_ns: Option<i64>,
    counts: TransformerCounts,
}

impl EnuTransformer {
    /// A transformer without poses.
    pub fn new(options: TransformerOptions) -> Self {
        let poses = PoseBuffer::new(PoseBufferOptions {
            span_s: options.pose_span_s,
            max_gap_s: options.max_pose_gap_s,
            ..PoseBufferOptions::default()
        });
        let mut mounts = TransformBuffer::new(TransformBufferOptions {
            history_s: options.pose_span_s,
            ..TransformBufferOptions::default()
        });
        mounts.keep(&options.base_frame);
        if options.ins.source == InsSource::Tf {
            mounts.keep(&options.map_frame);
        }
        options.odom_frame.iter().for_each(|odom| mounts.keep(odom));
        let span_ns = (options.pose_span_s * 1e9) as i64;
        Self {
            ins: InsDecoder::new(options.ins.clone()),
            poses,
            stamps: StampGate::new(CLOCK_JUMP_NS, span_ns.max(CLOCK_JUMP_NS), AGREEING_POSES),
            mounts,
            waiting: Waiting::new(options.max_waiting_clouds, options.max_waiting_bytes),
            announced: false,
            odom_ns: None,
            last_now_ns: None,
            counts: TransformerCounts::default(),
            options,
        }
    }

    /// Goes on with other options, except for frames, INS, origin and what is kept of poses.
    pub fn set_options(&mut self, options: TransformerOptions) {
        self.poses.set_max_gap_s(options.max_pose_gap_s);
        self.waiting.set_max_clouds(options.max_waiting_clouds);
        self.options = options;
    }

    /// Takes a message of the INS.
    pub fn on_ins(&mut self, message: InsMessage, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        match self.ins.decode(message) {
            Ok(poses) => {
                for pose in poses {
                    self.on_pose(pose, &mut out);
                }
            }
            Err(InsRefusal::NotGood) => self.counts.poses_not_good += 1,
            Err(InsRefusal::Invalid) => self.counts.poses_invalid += 1,
        }
        self.announce_origin(&mut out);
        self.serve(now_ns, &mut out);
        out
    }

    /// Takes a cloud of a sensor; it comes out at once or when its poses have come.
    pub fn on_cloud(&mut self, message: Arc<PointCloud2>, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        self.counts.clouds_in += 1;
        match WaitingCloud::new(message, now_ns, &self.options) {
            Ok(cloud) => {
                self.mounts.keep(&cloud.frame);
                self.counts.clouds_queue_full += self.waiting.push(cloud);
                self.serve(now_ns, &mut out);
            }
            Err(error) => {
                log::debug!("cloud dropped: {error}");
                self.drop_cloud(Drop::Malformed);
            }
        }
        out
    }

    /// Lets clouds that have waited too long go. To be called now and then.
    pub fn tick(&mut self, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        self.serve(now_ns, &mut out);
        out
    }

    /// Ends the input: what still waits is counted as having come too early.
    pub fn finish(&mut self) {
        while self.waiting.take(0).is_some() {
            self.drop_cloud(Drop::PoseLate);
        }
    }

    /// Counters of clouds, points and poses, by reason.
    pub fn counts(&self) -> &TransformerCounts {
        &self.counts
    }

    /// Clouds that wait for their poses.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Newest pose of the machine in the map.
    pub fn newest_pose(&self) -> Option<StampedPose> {
        let stamp_ns = self.poses.newest_ns()?;
        let map_from_base = self.poses.at(stamp_ns).ok()?;
        Some(StampedPose {
            stamp_ns,
            map_from_base,
        })
    }

    fn on_pose(&mut self, mut pose: StampedPose, out: &mut Vec<EnuOutput>) {
        if let Some(correction) = &self.options.correction {
            pose.map_from_base = correction * pose.map_from_base;
        }
        if !self.stamps.passes(pose.stamp_ns) {
            self.counts.poses_stamp_jump += 1;
            return;
        }
        match self.poses.push(pose) {
            PushOutcome::Accepted => self.counts.poses_in += 1,
            PushOutcome::JumpedBack => {
                self.counts.poses_in += 1;
                self.on_time_jump(pose.stamp_ns);
            }
            PushOutcome::OutOfOrder => {
                self.counts.poses_out_of_order += 1;
                return;
            }
            PushOutcome::NotFinite => {
                self.counts.poses_invalid += 1;
                return;
            }
        }
        self.announce_pose(&pose, out);
    }

    /// Notices a receiving clock that jumped back.
    fn advance(&mut self, now_ns: i64) {
        let last_ns = self.last_now_ns.replace(now_ns).unwrap_or(now_ns);
        if now_ns < last_ns.saturating_sub(CLOCK_JUMP_NS) {
            while self.waiting.take(0).is_some() {
                self.drop_cloud(Drop::TimeJump);
            }
        }
    }

    /// The poses begin anew at `stamp_ns`: clouds that belong to the time before go.
    fn on_time_jump(&mut self, stamp_ns: i64) {
        self.counts.time_jumps += 1;
        self.mounts.clear_moving();
        self.odom_ns = None;
        let after = (stamp_ns as f64 + self.options.max_wait_s * 1e9) as i64;
        let mut i = 0;
        while let Some(cloud) = self.waiting.get(i) {
            if cloud.last_ns > after {
                self.waiting.take(i);
                self.drop_cloud(Drop::TimeJump);
            } else {
                i += 1;
            }
        }
    }

    /// Transforms what can be transformed by now, in the order of arrival.
    fn serve(&mut self, now_ns: i64, out: &mut Vec<EnuOutput>) {
        let mut i = 0;
        while let Some(cloud) = self.waiting.get(i) {
            match self.verdict(cloud, now_ns) {
                Verdict::Wait => i += 1,
                Verdict::Drop(reason) => {
                    self.waiting.take(i);
                    self.drop_cloud(reason);
                }
                Verdict::Transform => {
                    if let Some(cloud) = self.waiting.take(i) {
                        match self.transform(&cloud) {
                            Ok(points) => {
                                self.counts.clouds_out += 1;
                                out.push(EnuOutput::Points(Arc::new(points)));
                            }
                            Err(reason) => self.drop_cloud(reason),
                        }
                    }
                }
            }
        }
    }

    fn verdict(&self, cloud: &WaitingCloud, now_ns: i64) -> Verdict {
        let wait = |reason| {
            let waited_s = now_ns.saturating_sub(cloud.arrived_ns) as f64 * 1e-9;
            match waited_s > self.options.max_wait_s {
                true => Verdict::Drop(reason),
                false => Verdict::Wait,
            }
        };
        for stamp_ns in [cloud.first_ns, cloud.last_ns] {
            match self.map_from_base(stamp_ns) {
                Ok(_) => {}
                Err(PoseMiss::Empty | PoseMiss::AfterEnd { .. }) => return wait(Drop::PoseLate),
                Err(PoseMiss::BeforeStart { .. }) => return Verdict::Drop(Drop::BeforePoses),
                Err(PoseMiss::Gap { .. }) => return Verdict::Drop(Drop::PoseGap),
            }
            match self.mount(&cloud.frame, stamp_ns) {
                Ok(_) => {}
                Err(TfMiss::TooOld { .. } | TfMiss::Gap { .. }) => {
                    return Verdict::Drop(Drop::NoMount);
                }
                Err(_) => return wait(Drop::NoMount),
            }
        }
        Verdict::Transform
    }

    fn transform(&mut self, waiting: &WaitingCloud) -> Result<PointCloud2, Drop> {
        let message = &waiting.message;
        let layout = cloud::layout_of(message);
        let limits = CloudLimits {
            max_points: self.options.max_cloud_points,
        };
        let view = layout
            .view(&message.data, &limits)
            .map_err(|_| Drop::Malformed)?;
        let map_from_sensor = |stamp_ns: i64| -> Result<Isometry3<f64>, Drop> {
            let map_from_base = self.map_from_base(stamp_ns).map_err(|_| Drop::PoseGap)?;
            let mount = self.mount(&waiting.frame, stamp_ns);
            Ok(map_from_base * mount.map_err(|_| Drop::NoMount)?)
        };
        let range = RangeLimits {
            min_range_m: self.options.min_range_m,
            max_range_m: self.options.max_range_m,
        };
        let times = waiting.times.as_deref();
        let moved = transform_points(&view, waiting.stamp_ns, times, &range, map_from_sensor)?;
        let mut header = message.header.clone();
        header.stamp = Time::from_ns(waiting.stamp_ns);
        header.frame_id.clone_from(&self.options.map_frame);
        let passed = self.options.pass_fields.iter();
        let passed = passed.filter_map(|name| view.fields().iter().find(|f| f.name == *name));
        let passed: Vec<_> = passed.cloned().collect();
        let (precision, mut fields) = (self.options.precision, passed.clone());
        let seen_from = |i: usize| {
            let times = times.and_then(|times| times.get(i).copied());
            let pose = map_from_sensor(times.unwrap_or(waiting.stamp_ns));
            pose.map_or(Vector3::repeat(f64::NAN), |pose| pose.translation.vector)
        };
        if self.options.viewpoints {
            fields.extend(viewpoint::viewpoint_fields(precision));
        }
        let mut left_out = moved.left_out.iter().copied().peekable();
        let mut kept = (0..view.len()).filter(|i| left_out.next_if_eq(i).is_none());
        let append = |_, data: &mut Vec<u8>| {
            let i = kept.next().unwrap_or(view.len());
            for field in &passed {
                view.copy_field(field, i, data);
            }
            if self.options.viewpoints {
                viewpoint::append_viewpoint(&seen_from(i), precision, data);
            }
        };
        let points =
            cloud::message_with_fields(header, &moved.points_m, precision, &fields, append);
        self.counts.points_in += view.len() as u64;
        self.counts.points_out += moved.points_m.len() as u64;
        self.counts.points_not_finite += moved.not_finite as u64;
        self.counts.points_out_of_range += moved.out_of_range as u64;
        self.counts.points_no_time += moved.no_time as u64;
        Ok(points)
    }

    fn drop_cloud(&mut self, reason: Drop) {
        let counter = match reason {
            Drop::Malformed => &mut self.counts.clouds_malformed,
            Drop::BeforePoses => &mut self.counts.clouds_before_poses,
            Drop::PoseGap => &mut self.counts.clouds_pose_gap,
            Drop::PoseLate => &mut self.counts.clouds_pose_late,
            Drop::NoMount => &mut self.counts.clouds_no_mount,
            Drop::TimeJump => &mut self.counts.clouds_time_jump,
        };
        *counter += 1;
    }
}
