//! Choice of the poses of a replay, and of the frames of map and machine.

use lattice_bag::BagReader;
use lattice_msgs::RosMessage;
use lattice_msgs::sensor_msgs::Imu;
use lattice_msgs::tf2_msgs::TFMessage;

use super::survey::{self, CloudTopic, FrameTree, PoseTopic};
use super::topic_plan::TopicWishes;
use super::topics::{TopicError, find, listing};
use crate::cloud_input::CloudType;
use crate::enu_transformer::ins::InsSource;

/// Mean rate below which poses alone leave gaps that are not interpolated (`max_pose_gap_s`), Hz.
const SPARSE_HZ: f64 = 4.0;
/// Distance between odometry and transforms of the same frames beyond which they are of two estimators: a fifth of the
/// edge of a default cell, m.
const MAX_CONTRADICTION_M: f64 = 0.1;
const MAP: &str = "map";
/// Frame of lidar odometry.
const ODOM: &str = "odom";
const BASE: &str = "base_link";

/// Poses of the machine itself come first: they need no mount.
const PREFERRED: [InsSource; 6] = [
    InsSource::Odometry,
    InsSource::Inspvax,
    InsSource::Inspva,
    InsSource::NavsatfixImu,
    InsSource::Pose,
    InsSource::PoseWithCovariance,
];

/// The poses that were chosen.
pub(super) struct Poses {
    pub source: InsSource,
    /// Topics with their types.
    pub topics: Vec<(usize, &'static str)>,
    /// Frame that they are in; empty where they name none, or are geodetic.
    pub frame: String,
    pub base_frame: String,
    /// Cloud topic of lidar odometry, where the log has no poses.
    pub odometry: Option<usize>,
    /// Topic of a gyroscope for it.
    pub imu: Option<usize>,
}

/// Poses, and the reason for which others come before them.
type Found = (Poses, Result<(), String>);

/// A log with its clouds, transforms and frames.
pub(super) struct Log<'a> {
    pub bag: &'a BagReader,
    pub wishes: &'a TopicWishes,
    pub clouds: Vec<CloudTopic>,
    pub tree: FrameTree,
    /// Transform topics, each with whether it is static.
    pub transforms: Vec<(usize, bool)>,
    /// Topics that were not taken, with the reason.
    pub choices: Vec<String>,
}

impl Log<'_> {
    pub fn name(&self, topic: usize) -> &str {
        let topic = self.bag.topics().get(topic);
        topic.map_or("", |topic| topic.name.as_str())
    }

    pub fn count(&self, topic: usize) -> u64 {
        let topic = self.bag.topics().get(topic);
        topic.map_or(0, |topic| topic.message_count)
    }

    fn rate_hz(&self, topic: usize) -> f64 {
        self.count(topic) as f64 / self.span_s().max(1e-9)
    }

    fn span_s(&self) -> f64 {
        let (start, end) = (self.bag.start_ns(), self.bag.end_ns());
        end.unwrap_or(0).saturating_sub(start.unwrap_or(0)) as f64 * 1e-9
    }

    /// The base frame unless an odometry names another: as wished, or `base_link` where the log has it.
    fn known_base(&self) -> Option<String> {
        let is_there = self.tree.contains(BASE) || self.clouds.iter().any(|c| c.frame == BASE);
        let wished = self.wishes.base_frame.clone();
        wished.or(is_there.then(|| BASE.to_owned()))
    }

    /// The poses to take: of the source that is wished, or of the first whose frames transforms connect.
    pub fn poses(&mut self) -> Result<Poses, TopicError> {
        if self.wishes.lidar_odometry {
            return self.of_scans();
        }
        if let Some(source) = self.wishes.source {
            let found = self.of_source(source)?;
            return found.map(|(poses, _)| poses).ok_or_else(|| {
                let type_name = source.type_names().iter();
                let missing = type_name
                    .copied()
                    .find(|t| survey::topics_of(self.bag, t).next().is_none());
                TopicError::Missing {
                    name: "*".into(),
                    type_name: missing.unwrap_or(TFMessage::TYPE),
                    has: listing(self.bag),
                }
            });
        }
        let mut worse: Vec<(String, Poses, String)> = Vec::new();
        let tf = self.of_source(InsSource::Tf)?.map(|(poses, _)| poses);
        for source in PREFERRED {
            let Some((poses, fit)) = self.of_source(source)? else {
                continue;
            };
            let Some((topic, _)) = poses.topics.first().copied() else {
                continue;
            };
            let name = self.name(topic).to_owned();
            let rate_hz = self.rate_hz(topic);
            if source != InsSource::NavsatfixImu && rate_hz < SPARSE_HZ {
                worse.push((name, poses, format!("its {rate_hz:.1} Hz leave gaps")));
                continue;
            }
            match fit {
                Ok(()) => {
                    self.explain(worse);
                    return Ok(poses);
                }
                Err(why) => worse.push((name, poses, why)),
            }
        }
        if let Some(tf) = tf {
            self.explain(worse);
            return Ok(tf);
        }
        if worse.is_empty() {
            return self.of_scans();
        }
        // Refused by name, pose by pose.
        let (_, poses, _) = worse.remove(0);
        self.explain(worse);
        Ok(poses)
    }

    fn explain(&mut self, worse: Vec<(String, Poses, String)>) {
        let lines = worse.into_iter().map(|(name, poses, why)| {
            format!("not taken: {name} ({why}; --ins {} takes it)", poses.source)
        });
        self.choices.extend(lines);
    }

    /// Poses of a source, and the reason for which others come before them.
    fn of_source(&mut self, source: InsSource) -> Result<Option<Found>, TopicError> {
        if source == InsSource::Tf {
            return Ok(self.of_tf().map(|poses| (poses, Ok(()))));
        }
        let mut topics = Vec::new();
        let (mut frame, mut base, mut connected) = (String::new(), self.known_base(), true);
        let (mut unusable, mut contradicted_by_m) = (None, 0.0);
        for (i, type_name) in source.type_names().iter().enumerate() {
            let mut candidates = survey::poses(self.bag, type_name)?;
            if let (0, Some(name)) = (i, &self.wishes.ins) {
                let wished = find(self.bag, name, type_name)?;
                candidates.retain(|candidate| candidate.topic == wished);
            }
            let Some(best) = self.best(&candidates, base.as_deref()) else {
                return Ok(None);
            };
            if i == 0 {
                frame.clone_from(&best.frame);
                if base.is_none() && !best.child.is_empty() {
                    base = Some(best.child.clone());
                }
                connected = self.is_connected(best, base.as_deref());
                if source == InsSource::Odometry {
                    contradicted_by_m = survey::contradiction_m(self.bag, best, &self.transforms)?;
                }
            }
            unusable = unusable.or(best.unusable);
            let taken = best.topic;
            for other in candidates.iter().filter(|c| c.topic != taken) {
                let (name, taken) = (self.name(other.topic), self.name(taken));
                let choose = match i {
                    0 => format!("--ins-topic {name} takes it"),
                    _ => "ins.imu_topic names it".to_owned(),
                };
                let line = format!("not taken: {name} (of the type of {taken}; {choose})");
                if !self.choices.contains(&line) {
                    self.choices.push(line);
                }
            }
            topics.push((taken, *type_name));
        }
        Ok(Some((
            Poses {
                source,
                topics,
                frame,
                base_frame: base.unwrap_or_else(|| BASE.to_owned()),
                odometry: None,
                imu: None,
            },
            match (unusable, connected) {
                (Some(why), _) => Err(why.to_owned()),
                (None, true) if contradicted_by_m > MAX_CONTRADICTION_M => Err(format!(
                    "the transforms contradict it by {contradicted_by_m:.1} m"
                )),
                (None, false) => Err("no transform connects its frame with the machine".to_owned()),
                (None, true) => Ok(()),
            },
        )))
    }

    /// The best topic of a type: usable, in the namespace of the clouds, connected with the machine, filtered (as
    /// robot_localization names what it fuses), with the most messages.
    fn best<'c>(&self, candidates: &'c [PoseTopic], base: Option<&str>) -> Option<&'c PoseTopic> {
        let rank = |candidate: &&PoseTopic| {
            let name = self.name(candidate.topic);
            (
                candidate.unusable.is_none(),
                self.rate_hz(candidate.topic) >= SPARSE_HZ,
                self.is_beside_clouds(name),
                self.is_connected(candidate, base),
                name.contains("filtered"),
                self.count(candidate.topic),
                std::cmp::Reverse(candidate.topic),
            )
        };
        candidates.iter().max_by_key(rank)
    }

    fn is_beside_clouds(&self, name: &str) -> bool {
        let first = |name: &str| {
            name.trim_start_matches('/')
                .split('/')
                .next()
                .map(str::to_owned)
        };
        let clouds = self.clouds.iter();
        clouds
            .into_iter()
            .any(|cloud| first(self.name(cloud.topic)) == first(name))
    }

    fn is_connected(&self, pose: &PoseTopic, base: Option<&str>) -> bool {
        let child = pose.child.as_str();
        child.is_empty() || base.is_none_or(|base| self.tree.connects(base, child))
    }

    /// Poses by lidar odometry, of the machine where transforms connect it with clouds, else of a sensor.
    fn of_scans(&self) -> Result<Poses, TopicError> {
        let scans = { self.clouds.iter() }.filter(|cloud| cloud.cloud_type.is_some());
        let best = scans.max_by_key(|cloud| {
            let is_carried = |base: &String| self.tree.connects(base, &cloud.frame);
            let is_carried = self.known_base().is_some_and(|base| is_carried(&base));
            (
                is_carried,
                !cloud.cloud_type.is_some_and(CloudType::is_planar),
                self.count(cloud.topic),
                std::cmp::Reverse(cloud.topic),
            )
        });
        if best.is_none() && !self.clouds.is_empty() {
            let depth: Vec<&str> = self.clouds.iter().map(|c| self.name(c.topic)).collect();
            return Err(TopicError::NoPoses {
                depth: depth.join(", "),
                has: listing(self.bag),
            });
        }
        let (topic, frame) = best.map_or((None, ODOM), |best| (Some(best.topic), &best.frame));
        let base = self
            .known_base()
            .filter(|base| self.tree.connects(base, frame));
        let base_frame = base.unwrap_or_else(|| self.tree.static_root(frame));
        let imu = self.gyroscope(&base_frame)?;
        Ok(Poses {
            source: InsSource::Odometry,
            topics: Vec::new(),
            frame: ODOM.to_owned(),
            base_frame,
            odometry: topic,
            imu,
        })
    }

    /// The Imu with the most samples that transforms connect with the machine.
    pub fn gyroscope(&self, base: &str) -> Result<Option<usize>, TopicError> {
        let mut connected = Vec::new();
        for topic in survey::topics_of(self.bag, Imu::TYPE) {
            let frame = survey::first::<Imu>(self.bag, topic)?.map(|imu| imu.header.frame_id);
            let is_connected = |frame: String| self.tree.connects(base, &survey::bare(&frame));
            if frame.is_some_and(is_connected) {
                connected.push(topic);
            }
        }
        let most = |topic: &usize| (self.count(*topic), std::cmp::Reverse(*topic));
        Ok(connected.into_iter().max_by_key(most))
    }

    /// Poses by transforms alone, from a frame of the world to the machine.
    fn of_tf(&self) -> Option<Poses> {
        let in_tree = |frame: &str| self.tree.contains(frame).then(|| frame.to_owned());
        let base_frame = self.wishes.base_frame.clone();
        let base_frame = base_frame.or(in_tree(BASE)).or(in_tree("base_footprint"));
        let base_frame = base_frame.or_else(|| {
            let carried = self
                .clouds
                .iter()
                .find(|cloud| self.tree.contains(&cloud.frame))?;
            Some(self.tree.static_root(&carried.frame))
        })?;
        let map_frame = self.wishes.map_frame.clone().unwrap_or_else(|| {
            match self.tree.is_world_of(MAP, &base_frame) {
                true => MAP.to_owned(),
                false => self.tree.root(&base_frame),
            }
        });
        self.tree
            .is_world_of(&map_frame, &base_frame)
            .then(|| Poses {
                source: InsSource::Tf,
                topics: Vec::new(),
                frame: map_frame,
                base_frame,
                odometry: None,
                imu: None,
            })
    }

    /// Frame of the map: `map_frame` if set, else `map` if transforms connect it with the frame of the poses, else the
    /// frame of the poses. Poses from transforms alone are always in the latter.
    pub fn map_frame(&self, poses: &Poses) -> String {
        if let Some(map_frame) = &self.wishes.map_frame {
            return map_frame.clone();
        }
        match poses.source {
            InsSource::Tf => poses.frame.clone(),
            _ if poses.frame.is_empty() || self.tree.connects(MAP, &poses.frame) => MAP.to_owned(),
            _ => poses.frame.clone(),
        }
    }
}
