//! From sensor clouds and an INS to clouds in the map frame (east, north, up).
//!
//! [`EnuTransformer`] is a state machine without I/O; [`node`] runs it behind DDS.

mod attitude;
mod cloud_clocks;
mod cloud_notes;
mod cloud_times;
mod counts;
mod drops;
mod fixes;
pub mod ins;
mod ins_refusal;
mod link_orders;
pub mod node;
mod options;
mod parameters;
mod placing;
mod pose_frames;
mod pose_intake;
mod refusals;
#[cfg(feature = "bags")]
mod samples;
mod speed_gate;
mod stamp_order;
mod transforms;
mod verdict;
mod waiting;

pub use attitude::AttitudeReport;
pub use cloud_notes::CloudNote;
pub(crate) use cloud_notes::CloudNotes;
pub(crate) use cloud_times::CloudTimes;
pub use counts::{TransformerCounts, TransformerReport};
pub use options::TransformerOptions;
pub(crate) use options::time_options;
pub use parameters::declare;
pub use refusals::{Refusal, Refusals, most_frequent};
#[cfg(feature = "bags")]
pub use samples::{LogSamples, StatedMount};
pub(crate) use stamp_order::StampOrder;

use std::collections::VecDeque;
use std::sync::Arc;

use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, PoseMiss, StampedPose, TransformBuffer, TransformBufferOptions,
};
use lattice_msgs::geographic_msgs::GeoPointStamped;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::sensor_msgs::PointCloud2;

use self::attitude::Attitudes;
use self::cloud_clocks::CloudClocks;
use self::drops::Drop;
use self::ins::{InsDecoder, InsMessage, InsSource};
use self::link_orders::LinkOrders;
use self::pose_frames::{Reference, WaitingPose};
use self::speed_gate::SpeedGate;
use self::verdict::Verdict;
use self::waiting::{Waiting, WaitingCloud};
use crate::cloud_input::CloudInputError;

/// Backward step of the receiving clock above which a log is taken to repeat, ns.
const CLOCK_JUMP_NS: i64 = 1_000_000_000;
/// Fraction of the waiting time of a cloud after which a new position of the machine is accepted, so that clouds
/// there are still waiting.
const SETTLE_PART: f64 = 0.5;

/// Output of the transformer.
#[derive(Clone, Debug)]
pub enum EnuOutput {
    /// Cloud for `points_enu`.
    Points(Arc<PointCloud2>),
    /// Transform for `/tf`.
    Transform(TransformStamped),
    /// Transform for `/tf_static`: `earth` -> `map`.
    StaticTransform(TransformStamped),
    /// Origin for `map_origin`.
    Origin(GeoPointStamped),
}

/// Transforms clouds of any number of sensors into the map frame, each point at its own time.
///
/// Clouds wait in a bounded queue until poses and mounts cover all of their points; nothing is extrapolated. Every
/// input has the time of its reception (`now_ns`): of the clock of the node, or of the log.
pub struct EnuTransformer {
    options: TransformerOptions,
    ins: InsDecoder,
    poses: PoseBuffer,
    attitudes: Attitudes,
    /// Order and speed of the poses of the machine in the map.
    order: StampOrder<StampedPose>,
    speed: SpeedGate<StampedPose>,
    /// Expected delay of late poses, ns.
    expected_delay_ns: i64,
    /// Topic of the last pose.
    pose_topic: Arc<str>,
    mounts: TransformBuffer,
    links: LinkOrders,
    waiting: Waiting,
    clocks: CloudClocks,
    notes: CloudNotes,
    waiting_poses: VecDeque<WaitingPose>,
    reference: Reference,
    /// Frame of the poses, if it is not the map frame.
    pose_frame: Option<Arc<str>>,
    has_warned_reference: bool,
    announced: bool,
    /// Stamp of the newest `map` -> `odom_frame`.
    odom_ns: Option<i64>,
    last_now_ns: Option<i64>,
    counts: TransformerCounts,
    refusals: Refusals,
    /// Samples for the calibration of mounts, in place of clouds.
    #[cfg(feature = "bags")]
    samples: Option<samples::Samples>,
}

impl EnuTransformer {
    /// Creates a transformer without poses.
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
        let ahead_ns = ((options.pose_span_s * 1e9) as i64).max(CLOCK_JUMP_NS);
        let settle_ns = (options.max_wait_s * SETTLE_PART * 1e9) as i64;
        let mut ins = options.ins.clone();
        (ins.ahead_ns, ins.settle_ns) = (ahead_ns, settle_ns);
        Self {
            order: StampOrder::new(ahead_ns),
            speed: SpeedGate::new(ins.max_speed_m_per_s, settle_ns),
            pose_topic: "".into(),
            expected_delay_ns: 0,
            links: LinkOrders::default(),
            clocks: CloudClocks::default(),
            notes: CloudNotes::default(),
            ins: InsDecoder::new(ins),
            poses,
            attitudes: Attitudes::default(),
            mounts,
            waiting: Waiting::new(options.max_waiting_clouds, options.max_waiting_bytes),
            waiting_poses: VecDeque::new(),
            reference: Reference::Unknown,
            pose_frame: None,
            has_warned_reference: false,
            announced: false,
            odom_ns: None,
            last_now_ns: None,
            counts: TransformerCounts::default(),
            refusals: Refusals::default(),
            #[cfg(feature = "bags")]
            samples: None,
            options,
        }
    }

    /// Options.
    #[cfg(feature = "bags")]
    pub(crate) fn options(&self) -> &TransformerOptions {
        &self.options
    }

    /// Changes the options, except for frames, INS, origin and the buffer of poses.
    pub fn set_options(&mut self, options: TransformerOptions) {
        self.poses.set_max_gap_s(options.max_pose_gap_s);
        self.waiting.set_max_clouds(options.max_waiting_clouds);
        self.options = options;
    }

    /// Handles a message of the INS on a topic.
    pub fn on_ins(&mut self, topic: &str, message: InsMessage, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        match self.ins.decode(message) {
            Ok(poses) => {
                for pose in poses {
                    self.on_body_pose(topic, pose, now_ns, &mut out);
                }
            }
            Err(refusal) => self.refuse_message(topic, &refusal),
        }
        for refusal in self.ins.take_refused() {
            self.refuse_message(topic, &refusal);
        }
        self.announce_origin(&mut out);
        self.serve(now_ns, &mut out);
        out
    }

    /// Handles a cloud of a sensor on a topic; it is returned at once, or later when its poses have arrived.
    pub fn on_cloud(
        &mut self,
        topic: &str,
        message: Arc<PointCloud2>,
        now_ns: i64,
    ) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        self.counts.clouds_in += 1;
        match WaitingCloud::new(topic, message, now_ns, &self.options, &mut self.notes) {
            Ok(mut cloud) => {
                self.mounts.keep(&cloud.frame);
                let newest_ns = self.poses.newest_ns();
                let Some(clock) = self.clocks.on_cloud(topic, cloud.stamp_ns, newest_ns) else {
                    self.drop_cloud(topic, &Drop::TimeJump);
                    return out;
                };
                cloud.clock = clock;
                cloud.newest_pose_ns = newest_ns;
                let gone = self.waiting.push(cloud);
                for cloud in gone {
                    self.drop_cloud(&cloud.topic, &Drop::QueueFull);
                }
                self.serve(now_ns, &mut out);
            }
            Err(error) => self.drop_cloud(topic, &Drop::Malformed(error)),
        }
        out
    }

    /// Counts a cloud of a topic that was not converted.
    pub fn on_unconverted(&mut self, topic: &str, error: &CloudInputError) {
        self.counts.clouds_in += 1;
        self.drop_cloud(topic, &Drop::Unconverted(error.clone()));
    }

    /// Counts a message of a topic that did not decode.
    pub fn on_undecodable(&mut self, topic: &str, error: &dyn std::fmt::Display) {
        self.refusals
            .add(topic, "undecodable", || format!("does not decode: {error}"));
    }

    /// Drops clouds that have waited too long. To be called periodically.
    pub fn tick(&mut self, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        self.serve(now_ns, &mut out);
        out
    }

    /// Ends the input: returns the clouds that poses cover, and counts the others by the reason of their drop.
    pub fn finish(&mut self) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.refuse_waiting_poses();
        self.finish_poses();
        while let Some(cloud) = self.waiting.take(0) {
            match self.coverage(&cloud) {
                Ok(()) => self.place(&cloud, &mut out),
                Err(uncovered) => {
                    let reason = match uncovered.reason {
                        Drop::PoseLate {
                            miss: Some(PoseMiss::AfterEnd { .. }),
                            ahead_ns,
                        } => Drop::PoseLate {
                            miss: None,
                            ahead_ns,
                        },
                        reason => reason,
                    };
                    self.drop_cloud(&cloud.topic, &reason);
                }
            }
        }
        out
    }

    /// Notes on corrected layouts of clouds, and on the source of the times of their points.
    pub fn notes(&self) -> &[CloudNote] {
        self.notes.all()
    }

    /// Sets the expected delay of poses, ns, which applies until a pose has been late.
    pub fn expect_delay(&mut self, delay_ns: i64) {
        self.expected_delay_ns = delay_ns;
    }

    /// Rejected messages by topic and reason.
    pub fn refusals(&self) -> &Refusals {
        &self.refusals
    }

    /// Counters of clouds, points and poses, by reason.
    pub fn counts(&self) -> &TransformerCounts {
        &self.counts
    }

    /// Number of clouds that wait for their poses.
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

    /// Handles a backward step of the receiving clock.
    fn advance(&mut self, now_ns: i64) {
        let last_ns = self.last_now_ns.replace(now_ns).unwrap_or(now_ns);
        if now_ns < last_ns.saturating_sub(CLOCK_JUMP_NS) {
            self.refuse_waiting_poses();
            while let Some(cloud) = self.waiting.take(0) {
                self.drop_cloud(&cloud.topic, &Drop::TimeJump);
            }
        }
    }

    /// Transforms all clouds that can be transformed now, in the order of arrival.
    fn serve(&mut self, now_ns: i64, out: &mut Vec<EnuOutput>) {
        self.settle_poses(now_ns, out);
        let mut i = 0;
        while let Some(cloud) = self.waiting.get(i) {
            match self.verdict(cloud, now_ns) {
                Verdict::Wait => i += 1,
                Verdict::Drop(reason) => {
                    if let Some(cloud) = self.waiting.take(i) {
                        self.drop_cloud(&cloud.topic, &reason);
                    }
                }
                Verdict::Transform => {
                    if let Some(cloud) = self.waiting.take(i) {
                        self.place(&cloud, out);
                    }
                }
            }
        }
    }
}
