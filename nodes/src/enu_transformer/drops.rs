//! Dropped clouds: reasons, counters and texts.

use lattice_core::cloud::CloudError;
use lattice_core::pose::{PoseMiss, TfMiss};

use super::ins_options::InsSource;
use super::state::EnuTransformer;
use crate::cloud_input::CloudInputError;

/// Reason for dropping a cloud.
pub(super) enum Drop {
    Malformed(CloudError),
    Unconverted(CloudInputError),
    BeforePoses {
        by_ns: i64,
        /// Time from the cloud to the newest pose.
        behind_ns: i64,
    },
    PoseGap(PoseMiss),
    /// No covering pose at the end of the wait; `None`: the input ended.
    PoseLate {
        miss: Option<PoseMiss>,
        /// Time from the newest pose at the reception to the cloud; `None` if no pose came since.
        ahead_ns: Option<i64>,
    },
    NoMount {
        frame: String,
        miss: TfMiss,
    },
    TimeJump,
    QueueFull,
}

impl Drop {
    pub fn no_mount(frame: &str, miss: TfMiss) -> Self {
        Self::NoMount {
            frame: frame.to_owned(),
            miss,
        }
    }
}

impl EnuTransformer {
    /// Counts a dropped cloud of a topic, with the text of its reason.
    pub(super) fn drop_cloud(&mut self, topic: &str, reason: &Drop) {
        let counts = &mut self.counts;
        let (counter, name) = match reason {
            Drop::Malformed(_) | Drop::Unconverted(_) => {
                (&mut counts.clouds_malformed, "clouds_malformed")
            }
            Drop::BeforePoses { .. } => (&mut counts.clouds_before_poses, "clouds_before_poses"),
            Drop::PoseGap(_) => (&mut counts.clouds_pose_gap, "clouds_pose_gap"),
            Drop::PoseLate { .. } => (&mut counts.clouds_pose_late, "clouds_pose_late"),
            Drop::NoMount { .. } => (&mut counts.clouds_no_mount, "clouds_no_mount"),
            Drop::TimeJump => (&mut counts.clouds_time_jump, "clouds_time_jump"),
            Drop::QueueFull => (&mut counts.clouds_queue_full, "clouds_queue_full"),
        };
        *counter += 1;
        // The text needs the rest of the machine.
        let mut refusals = std::mem::take(&mut self.refusals);
        let poses = refusals.most_frequent("poses_").cloned();
        refusals.add(topic, name, || {
            let poses = poses.map(|refusal| format!("{}: {}", refusal.topic, refusal.text));
            self.text(reason, poses)
        });
        self.refusals = refusals;
    }

    /// Text with value, limit and remedy; `poses` is the most frequent reason for rejected poses.
    fn text(&self, reason: &Drop, poses: Option<String>) -> String {
        let options = &self.options;
        let no_poses = self.counts.poses_in == 0;
        match reason {
            Drop::Malformed(error) => error.to_string(),
            Drop::Unconverted(error) => error.to_string(),
            Drop::BeforePoses { by_ns, behind_ns } => {
                let by_s = seconds(*by_ns);
                let clocks = other_clock(seconds(*behind_ns));
                format!("{by_s:.3} s before the first pose{clocks}")
            }
            Drop::PoseGap(PoseMiss::Gap { gap_ns, .. }) => {
                let (gap_s, max_gap_s) = (seconds(*gap_ns), options.max_pose_gap_s);
                let fixes = match options.ins.source {
                    InsSource::NavsatfixImu => {
                        let max_gap_s = options.ins.max_fix_gap_s;
                        format!(
                            "; between fixes up to {max_gap_s} s (`ins.max_fix_gap_s`) apart, positions are interpolated"
                        )
                    }
                    _ => String::new(),
                };
                format!(
                    "poses around it are {gap_s:.3} s apart, over {max_gap_s} s (`max_pose_gap_s`){fixes}"
                )
            }
            Drop::PoseGap(miss) => miss.to_string(),
            Drop::PoseLate { .. } if no_poses => match poses {
                Some(poses) => format!("no usable pose; {poses}"),
                None => self.no_pose(),
            },
            Drop::PoseLate {
                miss: Some(PoseMiss::AfterEnd { by_ns }),
                ahead_ns,
            } => {
                let (by_s, wait_s) = (seconds(*by_ns), options.longest_wait_s());
                let clocks =
                    ahead_ns.map_or_else(String::new, |by_ns| other_clock(-seconds(by_ns)));
                format!(
                    "{by_s:.3} s after the newest pose, and none came within {wait_s} s (`max_wait_s`){clocks}"
                )
            }
            Drop::PoseLate { .. } => {
                "no pose that covers it before the end of the input".to_owned()
            }
            Drop::NoMount { frame, miss } => self.no_mount(frame, miss),
            Drop::TimeJump => "time was set back while it waited for its pose".to_owned(),
            Drop::QueueFull => format!(
                "{} clouds or {} bytes wait for poses already (`max_waiting_clouds`, `max_waiting_bytes`)",
                options.max_waiting_clouds, options.max_waiting_bytes
            ),
        }
    }

    fn no_pose(&self) -> String {
        let (map, base) = (&self.options.map_frame, &self.options.base_frame);
        match self.options.ins.source {
            InsSource::Tf => format!(
                "no transform {map} <- {base} on /tf: set `map_frame` and `base_frame` to frames that tf connects, or `ins.source` to another source of poses"
            ),
            source => format!(
                "no pose was received; `ins.source` is {source}: check that its topic is published, or choose another"
            ),
        }
    }

    fn no_mount(&self, frame: &str, miss: &TfMiss) -> String {
        let base = &self.options.base_frame;
        let missing = format!("no transform {base} <- {frame}");
        match miss {
            TfMiss::UnknownFrame { .. } | TfMiss::Disconnected { .. } => {}
            miss => return format!("{missing} at its time: {miss}"),
        }
        match self.mounts.static_root(frame) {
            Some(root) if root != frame => {
                format!("{missing}; tf has {root} <- {frame}: try `-p base_frame:={root}`")
            }
            _ => format!(
                "{missing}: publish the mount of {frame} on /tf_static, or, if the poses are those of {frame} itself, set `-p base_frame:={frame}`"
            ),
        }
    }
}

/// Differences of common clocks, s: from GPS time to UTC, to TAI, and from UTC to TAI.
const CLOCKS_S: [(f64, &str); 3] = [
    (18.0, "that of GPS time and UTC"),
    (19.0, "that of GPS time and TAI"),
    (37.0, "that of UTC and TAI, as of PTP"),
];
/// Difference from one of them, s: of a delay of the poses.
const CLOCK_S: f64 = 0.5;
/// Least difference that is hardly a delay of the poses, s.
const LEAST_OFFSET_S: f64 = 1.5;

/// Remedy for stamps of clouds that need `offset_s` to be those of the poses that come with them.
fn other_clock(offset_s: f64) -> String {
    if offset_s.abs() < LEAST_OFFSET_S {
        return String::new();
    }
    let mut clocks = CLOCKS_S.iter();
    let known = clocks.find(|(s, _)| (offset_s.abs() - s).abs() < CLOCK_S);
    match known {
        Some((s, name)) => {
            let offset_s = s.copysign(offset_s);
            format!(
                "; the clocks of clouds and poses differ by {s} s, {name}: set `time.offset_s: {offset_s}`"
            )
        }
        None => format!(
            "; if the clocks of clouds and poses differ, set `time.offset_s: {offset_s:.1}`"
        ),
    }
}

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}
