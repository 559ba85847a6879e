//! Odometry from the clouds of a lidar: `odom` -> `base_link` and how far it can be trusted.
//!
//! [`LidarOdometry`] is a state machine without I/O around [`lattice_core::odometry`].

pub mod node;
mod options;
mod parameters;
mod path;

pub use options::LidarOdometryOptions;
pub use parameters::declare;

use lattice_core::cloud::CloudLimits;
use lattice_core::odometry::{
    LostCause, Odometry as Core, OdometryOptions, Prior, Scan, ScanResult, Verdict,
};
use lattice_core::pose::{TransformBuffer, TransformBufferOptions};
use lattice_msgs::geometry_msgs::{PoseWithCovariance, TransformStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::convert::{cloud, geometry};
use crate::enu_transformer::{CloudNote, CloudNotes, CloudTimes, Refusal, Refusals};

/// Pause between two scans below which the motion between them is that of the scans, ns.
pub(crate) const PAUSE_NS: i64 = 50_000_000;
/// Longest time between the stamps of two clouds that is no other clock, in ns.
const CLOCK_JUMP_NS: i64 = 1_000_000_000;

/// Counters of an odometry. Every cloud ends in exactly one of those behind `clouds_in`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OdometryCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Poses that the map holds in all directions.
    pub scans_ok: u64,
    /// Poses that are predicted along weak directions.
    pub scans_weak: u64,
    /// Poses that are predicted: the scan has too few points.
    pub lost_few_points: u64,
    /// Poses that are predicted: the map does not explain the scan.
    pub lost_no_overlap: u64,
    /// Poses that are predicted: the surfaces in view do not show the motion.
    pub lost_unobservable: u64,
    /// Poses without a verdict: the machine has not left the place where the map began.
    pub lost_one_place: u64,
    /// Dropped: the bytes are not what the header says, or no usable per-point time.
    pub clouds_malformed: u64,
    /// Dropped: no transform from the frame of the machine to that of the cloud.
    pub clouds_no_mount: u64,
    /// Dropped: older than the cloud before.
    pub clouds_out_of_order: u64,
    /// Submaps begun.
    pub submaps: u64,
    /// Length of the path of poses that are not lost, m.
    pub path_m: f64,
}

impl OdometryCounts {
    /// Poses that are predictions, for whichever reason.
    pub fn scans_lost(&self) -> u64 {
        self.lost_few_points + self.lost_no_overlap + self.lost_unobservable + self.lost_one_place
    }
}

/// The end of a `lidar_odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OdometryReport {
    /// Everything counted by the state machine.
    pub counts: OdometryCounts,
    /// Clouds that found the inbox, or the queue before it, full.
    pub clouds_inbox_full: u64,
    /// Clouds that were sent and did not come.
    pub clouds_lost_on_network: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Messages refused, by topic and reason, with value and remedy.
    pub refusals: Vec<Refusal>,
    /// Notes on clouds read otherwise than declared, and on the source of the times of their points.
    pub notes: Vec<CloudNote>,
}

/// Poses of a lidar, scan by scan.
pub struct LidarOdometry {
    options: LidarOdometryOptions,
    core: Core,
    mounts: TransformBuffer,
    notes: CloudNotes,
    refusals: Refusals,
    counts: OdometryCounts,
    last: Option<ScanResult>,
    /// End of the last scan with a certain pose.
    certain_ns: Option<i64>,
}

impl LidarOdometry {
    /// An odometry that has seen nothing.
    pub fn new(options: LidarOdometryOptions) -> Self {
        let mut mounts = TransformBuffer::new(TransformBufferOptions::default());
        mounts.keep(&options.base_frame);
        let core = OdometryOptions {
            lattice: options.lattice,
        };
        Self {
            core: Core::new(core),
            mounts,
            notes: CloudNotes::default(),
            refusals: Refusals::default(),
            counts: OdometryCounts::default(),
            last: None,
            certain_ns: None,
            options,
        }
    }

    /// Takes transforms of the mounts.
    pub fn on_tf(&mut self, message: &TFMessage, is_static: bool) {
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            if child.trim_start_matches('/') == self.options.base_frame {
                continue;
            }
            let Some(pose) = geometry::isometry_from_transform(&transform.transform) else {
                continue;
            };
            let stamp_ns = transform.header.stamp.to_ns();
            if let Err(error) = self.mounts.insert(parent, child, stamp_ns, pose, is_static) {
                let topic = if is_static { "/tf_static" } else { "/tf" };
                (self.refusals).add(topic, "transforms_refused", || error.to_string());
            }
        }
    }

    /// Takes a cloud; `None` if it gives no pose, which is counted by reason.
    pub fn on_cloud(&mut self, topic: &str, message: &PointCloud2) -> Option<ScanResult> {
        self.counts.clouds_in += 1;
        match self.register(topic, message) {
            Ok(result) => {
                self.count(&result);
                self.last = Some(result.clone());
                Some(result)
            }
            Err((reason, text)) => {
                match reason {
                    "clouds_no_mount" => self.counts.clouds_no_mount += 1,
                    "clouds_out_of_order" => self.counts.clouds_out_of_order += 1,
                    _ => self.counts.clouds_malformed += 1,
                }
                self.refusals.add(topic, reason, || text);
                None
            }
        }
    }

    fn register(
        &mut self,
        topic: &str,
        message: &PointCloud2,
    ) -> Result<ScanResult, (&'static str, String)> {
        let options = &self.options;
        let malformed = |error: &dyn std::fmt::Display| ("clouds_malformed", error.to_string());
        let time = options.deskew.then_some(&options.time);
        let max_points = options.max_cloud_points;
        let times = CloudTimes::read(topic, message, max_points, time, &mut self.notes)
            .map_err(|error| malformed(&error))?;
        if let Some(last) = &self.last
            && times.last_ns <= last.end_ns
        {
            if last.end_ns.saturating_sub(times.last_ns) > CLOCK_JUMP_NS {
                // A log that loops: another drive.
                self.core = Core::new(OdometryOptions {
                    lattice: options.lattice,
                });
            } else {
                let text = "a cloud that is older than the one before".to_owned();
                return Err(("clouds_out_of_order", text));
            }
        }
        let frame = message.header.frame_id.trim_start_matches('/');
        self.mounts.keep(frame);
        let base = options.base_frame.as_str();
        let mount = match frame == base {
            true => nalgebra::Isometry3::identity(),
            false => (self.mounts.lookup(base, frame, times.stamp_ns)).map_err(|miss| {
                let remedy = format!("publish it on /tf_static, or set `base_frame: {frame}`");
                ("clouds_no_mount", format!("{miss}; {remedy}"))
            })?,
        };
        let layout = cloud::layout_of(message);
        let view = (layout.view(&message.data, &CloudLimits { max_points }))
            .map_err(|error| malformed(&error))?;
        let range_m = options.min_range_m..=options.max_range_m;
        let is_kept = |p: &Vector3<f64>| {
            let distance_m = p.norm();
            // At the lower end are points in the sensor's own origin, by which many drivers say that there is no return.
            distance_m.is_finite() && range_m.contains(&distance_m) && distance_m > *range_m.start()
        };
        let points = (0..view.len()).map(|i| (i, view.xyz(i)));
        let (kept, points_m): (Vec<usize>, Vec<Vector3<f64>>) = points
            .filter(|(_, p)| is_kept(p))
            .map(|(i, p)| (i, (mount * Point3::from(p)).coords))
            .unzip();
        let times_ns: Option<Vec<i64>> = times.times_ns.as_ref().map(|times| {
            let of_kept = kept.iter().filter_map(|i| times.get(*i));
            of_kept.copied().collect()
        });
        let scan = Scan {
            points_m: &points_m,
            times_ns: times_ns.as_deref(),
            stamp_ns: times.stamp_ns,
        };
        let registered = self.core.register(&scan, &Prior::default());
        registered.map_err(|error| malformed(&error))
    }

    fn count(&mut self, result: &ScanResult) {
        let counts = &mut self.counts;
        *match &result.verdict {
            Verdict::Ok => &mut counts.scans_ok,
            Verdict::Weak(_) => &mut counts.scans_weak,
            Verdict::Lost(LostCause::FewPoints) => &mut counts.lost_few_points,
            Verdict::Lost(LostCause::NoOverlap) => &mut counts.lost_no_overlap,
            Verdict::Lost(LostCause::Unobservable) => &mut counts.lost_unobservable,
            Verdict::Lost(LostCause::OnePlace) => &mut counts.lost_one_place,
        } += 1;
        let is_lost = matches!(result.verdict, Verdict::Lost(_));
        counts.submaps = counts
            .submaps
            .max(u64::from(result.submap) + u64::from(!is_lost));
        if let Some(last) = self
            .last
            .as_ref()
            .filter(|last| last.submap == result.submap && !is_lost)
        {
            let moved =
                result.odom_from_base.translation.vector - last.odom_from_base.translation.vector;
            counts.path_m += moved.norm();
        }
    }

    /// Counters by reason.
    pub fn counts(&self) -> &OdometryCounts {
        &self.counts
    }

    /// Messages refused, by topic and reason.
    pub fn refusals(&self) -> &[Refusal] {
        self.refusals.all()
    }

    /// Notes on clouds read otherwise than declared, and on the source of the times of their points.
    pub fn notes(&self) -> &[CloudNote] {
        self.notes.all()
    }

    /// A pose as `nav_msgs/Odometry`.
    pub fn message(&self, result: &ScanResult) -> Odometry {
        let (odom, base) = (&self.options.odom_frame, &self.options.base_frame);
        odometry_message(odom, base, result)
    }

    /// Poses that cover a scan, if its place in the first submap is certain; else none. Clouds between them can be mapped.
    pub fn certain(&mut self, result: &ScanResult) -> Vec<Odometry> {
        if result.verdict != Verdict::Ok || result.submap > 0 {
            return Vec::new();
        }
        let before_ns = self.certain_ns.replace(result.end_ns);
        let follows = |before_ns: i64| result.first_ns.saturating_sub(before_ns) <= PAUSE_NS;
        let mut poses = Vec::new();
        if !before_ns.is_some_and(follows) && result.first_ns < result.end_ns {
            poses.push(self.message(&result.at_first()));
        }
        poses.push(self.message(result));
        poses
    }

    /// A pose as a transform.
    pub fn transform(&self, result: &ScanResult) -> TransformStamped {
        let (odom, base) = (&self.options.odom_frame, &self.options.base_frame);
        geometry::transform_stamped(odom, base, result.end_ns, &result.odom_from_base)
    }
}

/// A pose as `nav_msgs/Odometry`, stamped with the time of the last point.
pub fn odometry_message(odom_frame: &str, base_frame: &str, result: &ScanResult) -> Odometry {
    let mut covariance = [0.0; 36];
    for (i, to) in covariance.iter_mut().enumerate() {
        *to = result.covariance[(i / 6, i % 6)];
    }
    Odometry {
        header: geometry::header(odom_frame, result.end_ns),
        child_frame_id: base_frame.to_owned(),
        pose: PoseWithCovariance {
            pose: geometry::pose_from(&result.odom_from_base),
            covariance,
        },
        ..Odometry::default()
    }
}
