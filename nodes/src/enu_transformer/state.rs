//! State of the transformer: the poses, the mounts, the clouds that wait for them, and the counters.

use std::collections::VecDeque;
use std::sync::Arc;

use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, StampedPose, TransformBuffer, TransformBufferOptions,
};
use lattice_msgs::geographic_msgs::GeoPointStamped;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::sensor_msgs::PointCloud2;

use super::attitude::{AttitudeReport, Attitudes};
use super::cloud_clocks::CloudClocks;
use super::cloud_notes::{CloudNote, CloudNotes};
use super::counts::TransformerCounts;
use super::inertial::Inertial;
use super::ins::{InsDecoder, InsSource};
use super::link_orders::LinkOrders;
use super::options::TransformerOptions;
use super::reference::{Reference, WaitingPose};
use super::refusals::Refusals;
#[cfg(feature = "bags")]
use super::samples::Samples;
use super::speed_gate::SpeedGate;
use super::stamp_order::StampOrder;
use super::waiting::Waiting;

/// Backward step of the receiving clock above which a log is taken to repeat, ns.
pub(super) const CLOCK_JUMP_NS: i64 = 1_000_000_000;
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
    pub(super) options: TransformerOptions,
    pub(super) ins: InsDecoder,
    pub(super) poses: PoseBuffer,
    pub(super) attitudes: Attitudes,
    pub(super) inertial: Inertial,
    /// Order and speed of the poses of the machine in the map.
    pub(super) order: StampOrder<StampedPose>,
    pub(super) speed: SpeedGate<StampedPose>,
    /// Expected delay of late poses, ns.
    pub(super) expected_delay_ns: i64,
    /// Topic of the last pose.
    pub(super) pose_topic: Arc<str>,
    pub(super) mounts: TransformBuffer,
    pub(super) links: LinkOrders,
    pub(super) waiting: Waiting,
    pub(super) clocks: CloudClocks,
    pub(super) notes: CloudNotes,
    pub(super) waiting_poses: VecDeque<WaitingPose>,
    pub(super) reference: Reference,
    /// Frame of the poses, if it is not the map frame.
    pub(super) pose_frame: Option<Arc<str>>,
    pub(super) has_warned_reference: bool,
    pub(super) announced: bool,
    /// Stamp of the newest `map` -> `odom_frame`.
    pub(super) odom_ns: Option<i64>,
    pub(super) last_now_ns: Option<i64>,
    pub(super) counts: TransformerCounts,
    pub(super) refusals: Refusals,
    /// Samples for the calibration of mounts, in place of clouds.
    #[cfg(feature = "bags")]
    pub(super) samples: Option<Samples>,
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
            inertial: Inertial::default(),
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

    /// Contradiction between the attitudes of all poses so far and the way of the machine, or an Imu.
    pub fn attitude(&self) -> Option<AttitudeReport> {
        self.attitudes
            .report(self.inertial.finding(), &self.options)
    }

    /// Warns once of a contradiction of the attitudes.
    pub(super) fn warn_of_attitude(&mut self) {
        if !self.attitudes.is_told
            && let Some(report) = self.attitude()
        {
            self.attitudes.is_told = true;
            log::warn!("{}", report.text);
        }
    }
}
