//! Poses for a log that has none: lidar odometry over its clouds.

use std::collections::{BTreeMap, BTreeSet};

use lattice_bag::{BagReader, ReadOptions};
use lattice_core::loop_closure::Corrections;
use lattice_core::odometry::{ScanResult, Verdict};
use lattice_msgs::cdr;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{Imu, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use serde::{Deserialize, Serialize};

use super::topic_plan::TopicPlan;
use super::topics::{Role, TopicError};
use crate::cloud_input::SensorCloud;
use crate::enu_transformer::Refusal;
use crate::lidar_odometry::{
    DriveLoops, LidarOdometry, LidarOdometryOptions, OdometryCounts, PAUSE_NS, Registered,
    odometry_message,
};

/// Odometry of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanPosesReport {
    /// Topic of the clouds.
    pub topic: String,
    /// Scans by verdict, and length of the path.
    pub counts: OdometryCounts,
    /// Topic of the gyroscope; empty: none.
    pub imu_topic: String,
    /// Loops that closed, and those that were tried and did not.
    pub loops_closed: u64,
    /// Loops whose registration was not certain, or that the others contradict.
    pub loops_refused: u64,
    /// Submaps that are mapped: joined by loops.
    pub submaps_mapped: u64,
    /// Scans that are `OK` in the submaps that are mapped.
    pub scans_mapped: u64,
    /// Scans that are `OK` in submaps whose place in the mapped one is unknown.
    pub scans_elsewhere: u64,
    /// Clouds refused, by reason, with value and remedy.
    pub refusals: Vec<Refusal>,
}

impl ScanPosesReport {
    /// One line per loss.
    pub(super) fn losses(&self) -> Vec<String> {
        let counts = &self.counts;
        let all = counts.clouds_in;
        let reasons = [
            (
                "WEAK: the surfaces in view show the motion in part",
                counts.scans_weak,
            ),
            ("LOST: too few points", counts.lost_few_points),
            (
                "LOST: the map does not explain the scan",
                counts.lost_no_overlap,
            ),
            (
                "LOST: the surfaces in view do not show the motion",
                counts.lost_unobservable,
            ),
            (
                "LOST: the machine has not moved by 0.3 m since its map began",
                counts.lost_one_place,
            ),
            (
                "in submaps whose place in the map is unknown, as nothing joins them",
                self.scans_elsewhere,
            ),
        ];
        let lost = reasons.into_iter().filter(|(_, count)| *count > 0);
        let lost = lost.map(|(reason, count)| format!("{count} of {all} scans {reason}"));
        let refused = self.refusals.iter().map(|refusal| {
            let Refusal {
                topic,
                reason,
                count,
                text,
            } = refusal;
            format!("{count} on {topic} ({reason}): {text}")
        });
        lost.chain(refused).collect()
    }

    /// Cause for which no scan has a pose that is certain.
    pub(super) fn cause_of_nothing(&self) -> Option<String> {
        let counts = &self.counts;
        let all_lost = counts.clouds_in > 0 && counts.scans_ok == 0;
        all_lost.then(|| {
            let losses = self.losses().join("; ");
            format!("all scans of {} are lost: {losses}", self.topic)
        })
    }

    /// Clouds that are not given to the map.
    pub(super) fn left_out(&self) -> u64 {
        self.counts.clouds_in - self.scans_mapped.min(self.counts.clouds_in)
    }
}

impl std::fmt::Display for ScanPosesReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let counts = &self.counts;
        write!(
            f,
            "odometry: {} scans of {}: {} OK, {} WEAK, {} LOST; path {:.1} m, {} loops closed; {} mapped, {} of {} submaps",
            counts.clouds_in,
            self.topic,
            counts.scans_ok,
            counts.scans_weak,
            counts.scans_lost(),
            counts.path_m,
            self.loops_closed,
            self.scans_mapped,
            self.submaps_mapped,
            counts.submaps
        )
    }
}

/// An input of lidar odometry from a log.
pub enum OdometryInput<'a> {
    /// A cloud of a topic, with its log time.
    Cloud(&'a str, &'a PointCloud2, i64),
    /// A sample of a gyroscope, of a topic.
    Imu(&'a str, &'a Imu),
    /// The end of the log.
    End,
}

impl OdometryInput<'_> {
    /// Passes the input to an odometry; the tags of poses are log times of clouds.
    pub fn give(&self, machine: &mut LidarOdometry) -> Vec<Registered> {
        match self {
            Self::Cloud(topic, cloud, log_time_ns) => machine.on_cloud(topic, cloud, *log_time_ns),
            Self::Imu(topic, imu) => machine.on_imu(topic, imu).into_iter().collect(),
            Self::End => machine.finish().into_iter().collect(),
        }
    }
}

/// Passes the transforms of a log to an odometry, and the clouds of a topic and the gyroscope samples to `on_input`.
pub fn feed_odometry(
    bag: &BagReader,
    plan: &TopicPlan,
    topic: usize,
    machine: &mut LidarOdometry,
    on_input: &mut dyn FnMut(&mut LidarOdometry, OdometryInput),
    progress: &mut dyn FnMut(i64),
) -> Result<(), TopicError> {
    machine.on_tf(&plan.late_statics, true);
    let name = |topic: usize| {
        let topic = bag.topics().get(topic);
        topic.map_or("", |topic| topic.name.as_str())
    };
    let mut topics = plan.names(bag, |role| !matches!(role, Role::Ins(_)));
    topics.extend(plan.imu.map(|imu| name(imu).to_owned()));
    let read = ReadOptions {
        topics: Some(topics),
        ..ReadOptions::default()
    };
    for message in bag.messages(&read)? {
        let message = message?;
        match plan.roles.get(&message.topic) {
            Some(Role::Cloud(of)) if message.topic == topic => {
                // What does not decode or is not converted is counted when it is mapped.
                let decoded = of.decode(&message.data).ok();
                if let Some(Ok(cloud)) = decoded.map(SensorCloud::into_cloud) {
                    let input = OdometryInput::Cloud(name(topic), &cloud, message.log_time_ns);
                    on_input(machine, input);
                }
            }
            Some(Role::Transforms(is_static)) => {
                if let Ok(transforms) = cdr::from_slice::<TFMessage>(&message.data) {
                    machine.on_tf(&transforms, *is_static);
                }
            }
            _ if Some(message.topic) == plan.imu => {
                if let Ok(imu) = cdr::from_slice::<Imu>(&message.data) {
                    on_input(machine, OdometryInput::Imu(name(message.topic), &imu));
                }
            }
            _ => {}
        }
        progress(message.log_time_ns);
    }
    on_input(machine, OdometryInput::End);
    Ok(())
}

/// Poses of the scans of a log, by the log time of their clouds.
pub(super) struct ScanPoses {
    scans: BTreeMap<i64, ScanResult>,
    odom_frame: String,
    base_frame: String,
    /// The submaps that loops join, with the most scans that are `OK`.
    mapped: BTreeSet<u32>,
    corrections: Corrections,
    /// Time of the newest pose given.
    given_ns: Option<i64>,
    pub topic: usize,
    pub report: ScanPosesReport,
}

impl ScanPoses {
    /// Runs the odometry over the clouds of a topic, and corrects its poses by loops.
    pub fn of(
        bag: &BagReader,
        plan: &TopicPlan,
        topic: usize,
        options: LidarOdometryOptions,
        progress: &mut dyn FnMut(i64),
    ) -> Result<Self, TopicError> {
        let name = bag.topics().get(topic).map_or("", |topic| &topic.name);
        let (odom_frame, base_frame) = (options.odom_frame.clone(), options.base_frame.clone());
        let mut machine = LidarOdometry::new(options);
        let imu_name = plan.imu.and_then(|topic| bag.topics().get(topic));
        let imu_name = imu_name.map_or("", |topic| &topic.name);
        let mut scans = BTreeMap::new();
        let mut loops = DriveLoops::default();
        let on_input = &mut |machine: &mut LidarOdometry, input: OdometryInput| {
            for found in input.give(machine) {
                loops.add(&found);
                scans.insert(found.tag, found.result);
            }
        };
        feed_odometry(bag, plan, topic, &mut machine, on_input, progress)?;
        let mut in_submaps: BTreeMap<u32, u64> = BTreeMap::new();
        for scan in scans.values().filter(|scan| scan.verdict == Verdict::Ok) {
            *in_submaps.entry(scan.submap).or_default() += 1;
        }
        let loops = loops.finish(&mut machine);
        let count = |submaps: &BTreeSet<u32>| -> u64 {
            submaps.iter().filter_map(|one| in_submaps.get(one)).sum()
        };
        let joined = in_submaps.keys().map(|submap| loops.joined_with(*submap));
        // The earliest of equals.
        let mapped = joined.rev().max_by_key(count).unwrap_or_default();
        let scans_mapped = count(&mapped);
        let closed = loops.attempts().iter().filter(|attempt| attempt.is_closed);
        let loops_closed = closed.count() as u64;
        Ok(Self {
            report: ScanPosesReport {
                topic: name.to_owned(),
                imu_topic: imu_name.to_owned(),
                counts: machine.counts().clone(),
                loops_closed,
                loops_refused: loops.attempts().len() as u64 - loops_closed,
                submaps_mapped: mapped
                    .iter()
                    .filter(|one| in_submaps.contains_key(one))
                    .count() as u64,
                scans_mapped,
                scans_elsewhere: in_submaps.values().sum::<u64>() - scans_mapped,
                refusals: machine.refusals().to_vec(),
            },
            scans,
            odom_frame,
            base_frame,
            mapped,
            corrections: loops.corrections(),
            given_ns: None,
            topic,
        })
    }

    /// Poses that cover the cloud of a log time; `None` if it is not to be mapped.
    pub fn poses(&mut self, log_time_ns: i64) -> Option<Vec<Odometry>> {
        let is_mapped =
            |scan: &&ScanResult| scan.verdict == Verdict::Ok && self.mapped.contains(&scan.submap);
        let scan = self.scans.get(&log_time_ns).filter(is_mapped)?;
        let before = self.scans.range(..log_time_ns).next_back();
        let before = before.map(|(_, scan)| scan).filter(is_mapped);
        let follows = |before: &&ScanResult| {
            let pause_ns = scan.first_ns.saturating_sub(before.end_ns);
            before.submap == scan.submap && pause_ns <= PAUSE_NS
        };
        let mut poses = vec![self.message(scan)];
        if let Some(before) = before.filter(follows) {
            if self.given_ns != Some(before.end_ns) {
                poses.insert(0, self.message(before));
            }
        } else if scan.first_ns < scan.end_ns {
            poses.insert(0, self.message(&scan.at_first()));
        }
        self.given_ns = Some(scan.end_ns);
        Some(poses)
    }

    /// The pose, corrected by the loops.
    fn message(&self, scan: &ScanResult) -> Odometry {
        let mut corrected = scan.clone();
        corrected.odom_from_base = self.corrections.map_from_base(scan);
        odometry_message(&self.odom_frame, &self.base_frame, &corrected)
    }
}
