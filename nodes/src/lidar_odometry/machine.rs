//! Registration of each scan of a lidar, without I/O.

use lattice_core::cloud::CloudLimits;
use lattice_core::loop_closure::{Segment, SegmentCutter};
use lattice_core::odometry::{
    LostCause, Odometry as Core, OdometryOptions, Prior, Scan, ScanResult, Verdict,
};
use lattice_core::pose::{TransformBuffer, TransformBufferOptions};
use lattice_msgs::geometry_msgs::{PoseWithCovariance, TransformStamped};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{Imu, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::{Point3, Vector3};

use super::counts::OdometryCounts;
use super::motions::Motions;
use super::options::LidarOdometryOptions;
use crate::cloud_input::CloudInputError;
use crate::convert::{cloud, geometry};
use crate::enu_transformer::{CloudNote, CloudNotes, CloudTimes, Refusal, Refusals};

/// Pause between two scans below which the motion between them is that of the scans, ns.
pub(crate) const PAUSE_NS: i64 = 50_000_000;
/// Longest time between the stamps of two clouds that is no other clock, in ns.
const CLOCK_JUMP_NS: i64 = 1_000_000_000;

/// Pose of a scan, with the tag of its cloud.
#[derive(Clone, Debug)]
pub struct Registered {
    /// Tag given with the cloud.
    pub tag: i64,
    /// Pose and verdict.
    pub result: ScanResult,
    /// Number of the drive, from 0: another one begins where a log begins again.
    pub drive: u32,
    /// Segment of the drive that ends before the scan, if loops are sought.
    pub segment: Option<Segment>,
}

/// A scan in the frame of the machine.
struct ReadScan {
    topic: String,
    points_m: Vec<Vector3<f64>>,
    times_ns: Option<Vec<i64>>,
    stamp_ns: i64,
    tag: i64,
}

impl ReadScan {
    fn scan(&self) -> Scan<'_> {
        Scan {
            points_m: &self.points_m,
            times_ns: self.times_ns.as_deref(),
            stamp_ns: self.stamp_ns,
        }
    }
}

/// Poses of a lidar, scan by scan.
pub struct LidarOdometry {
    options: LidarOdometryOptions,
    core: Core,
    mounts: TransformBuffer,
    notes: CloudNotes,
    refusals: Refusals,
    counts: OdometryCounts,
    motions: Motions,
    /// Scan that waits for the motion up to its end.
    waiting: Option<ReadScan>,
    last: Option<ScanResult>,
    /// End of the last scan with a certain pose, and its submap.
    certain: Option<(i64, u32)>,
    /// Present if loops are sought.
    cutter: Option<SegmentCutter>,
    drive: u32,
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
            motions: Motions::new(),
            waiting: None,
            last: None,
            certain: None,
            cutter: options.loops.then(SegmentCutter::default),
            drive: 0,
            options,
        }
    }

    /// Handles transforms of the mounts.
    pub fn on_tf(&mut self, message: &TFMessage, is_static: bool) {
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            // The pose of the machine itself is that of other sources.
            if !is_static && child.trim_start_matches('/') == self.options.base_frame {
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

    /// Handles a sample of a gyroscope. Returns the pose of a scan that waited for it.
    pub fn on_imu(&mut self, topic: &str, imu: &Imu) -> Option<Registered> {
        let taken = (self.motions).on_imu(imu, &self.options.base_frame, &mut self.mounts);
        if let Err(text) = taken {
            self.counts.imu_refused += 1;
            self.refusals.add(topic, "imu_refused", || text);
        }
        self.register_if_complete()
    }

    /// Handles a pose of wheel odometry. Returns the pose of a scan that waited for it.
    pub fn on_wheels(&mut self, topic: &str, wheels: &Odometry) -> Option<Registered> {
        let taken = (self.motions).on_wheels(wheels, &self.options.base_frame, &mut self.mounts);
        if let Err(text) = taken {
            self.counts.wheels_refused += 1;
            self.refusals.add(topic, "wheels_refused", || text);
        }
        self.register_if_complete()
    }

    /// Handles a cloud. Returns the poses of earlier scans and of this one that need not wait for other sensors.
    /// Clouds without a pose are counted by reason. `tag` is returned with the pose.
    pub fn on_cloud(&mut self, topic: &str, message: &PointCloud2, tag: i64) -> Vec<Registered> {
        self.counts.clouds_in += 1;
        let mut found: Vec<Registered> = self.finish().into_iter().collect();
        match self.read(topic, message, tag) {
            Ok(scan) => {
                self.waiting = Some(scan);
                found.extend(self.register_if_complete());
            }
            Err((reason, text)) => {
                match reason {
                    "clouds_no_mount" => self.counts.clouds_no_mount += 1,
                    "clouds_out_of_order" => self.counts.clouds_out_of_order += 1,
                    _ => self.counts.clouds_malformed += 1,
                }
                self.refusals.add(topic, reason, || text);
            }
        }
        found
    }

    /// Counts a cloud of a topic that was not converted.
    pub fn on_unconverted(&mut self, topic: &str, error: &CloudInputError) {
        self.counts.clouds_in += 1;
        self.counts.clouds_malformed += 1;
        (self.refusals).add(topic, "clouds_malformed", || error.to_string());
    }

    /// The pose of the scan that waits, without further samples of other sensors.
    pub fn finish(&mut self) -> Option<Registered> {
        let scan = self.waiting.take()?;
        let result = self.register(&scan)?;
        self.count(&result);
        self.last = Some(result.clone());
        let segment = self.cut(&result);
        Some(Registered {
            tag: scan.tag,
            result,
            drive: self.drive,
            segment,
        })
    }

    /// Adds the newest scan to its segment, and gives the one that ends before it.
    fn cut(&mut self, result: &ScanResult) -> Option<Segment> {
        let (cutter, sizes) = (self.cutter.as_mut()?, self.core.sizes()?);
        let cut = cutter.add(result, self.core.centroids_m(), sizes.centroids_m);
        // Sizes that gave the scan a lattice give one here.
        cut.unwrap_or_else(|error| {
            log::debug!("no loop is sought: {error}");
            None
        })
    }

    /// The last segment of the drive, if loops are sought.
    pub fn last_segment(&mut self) -> Option<Segment> {
        self.cutter.as_mut()?.finish()
    }

    fn register_if_complete(&mut self) -> Option<Registered> {
        let (_, end_ns) = self.waiting.as_ref()?.scan().span_ns();
        match self.motions.is_awaited(end_ns) {
            true => None,
            false => self.finish(),
        }
    }

    fn register(&mut self, scan: &ReadScan) -> Option<ScanResult> {
        let (first_ns, end_ns) = scan.scan().span_ns();
        let before_ns = self.last.as_ref().map(|last| last.end_ns);
        let rates = before_ns.map(|before_ns| self.motions.rates(first_ns.min(before_ns), end_ns));
        let rates = rates.unwrap_or_default();
        let motion = before_ns.and_then(|before_ns| self.motions.wheels(before_ns, end_ns));
        self.counts.scans_with_imu += u64::from(!rates.is_empty());
        self.counts.scans_with_wheels += u64::from(motion.is_some());
        let prior = Prior {
            motion,
            rates: &rates,
        };
        match self.core.register(&scan.scan(), &prior) {
            Ok(result) => Some(result),
            Err(error) => {
                self.counts.clouds_malformed += 1;
                (self.refusals).add(&scan.topic, "clouds_malformed", || error.to_string());
                None
            }
        }
    }

    fn read(
        &mut self,
        topic: &str,
        message: &PointCloud2,
        tag: i64,
    ) -> Result<ReadScan, (&'static str, String)> {
        let options = &self.options;
        let malformed = |error: &dyn std::fmt::Display| ("clouds_malformed", error.to_string());
        let time = options.deskew.then_some(&options.time);
        let max_points = options.max_cloud_points;
        let times = CloudTimes::read(topic, message, max_points, time, 0, &mut self.notes)
            .map_err(|error| malformed(&error))?;
        if let Some(last_ns) = self.last.as_ref().map(|last| last.end_ns)
            && times.last_ns <= last_ns
        {
            if last_ns.saturating_sub(times.last_ns) > CLOCK_JUMP_NS {
                // A log that loops: another drive.
                (self.last, self.certain) = (None, None);
                self.cutter = self.cutter.take().map(|_| SegmentCutter::default());
                self.drive += 1;
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
        let times_ns = times.times_ns.as_ref().map(|times| {
            let of_kept = kept.iter().filter_map(|i| times.get(*i));
            of_kept.copied().collect()
        });
        Ok(ReadScan {
            topic: topic.to_owned(),
            points_m,
            times_ns,
            stamp_ns: times.stamp_ns,
            tag,
        })
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

    /// Poses that cover a scan, if its place in its submap is certain; else none. Clouds between them can be mapped. Where no
    /// loops are sought, only the first submap has poses.
    pub fn certain(&mut self, result: &ScanResult) -> Vec<Odometry> {
        if result.verdict != Verdict::Ok || result.submap > 0 && !self.options.loops {
            return Vec::new();
        }
        let before = self.certain.replace((result.end_ns, result.submap));
        let follows = |(before_ns, submap): (i64, u32)| {
            submap == result.submap && result.first_ns.saturating_sub(before_ns) <= PAUSE_NS
        };
        let mut poses = Vec::new();
        if !before.is_some_and(follows) && result.first_ns < result.end_ns {
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
