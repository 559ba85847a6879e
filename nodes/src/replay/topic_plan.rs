//! Wishes of the user, and the topics and frames that are taken.

use std::collections::BTreeMap;

use lattice_bag::{BagReader, TopicInfo};
use lattice_msgs::tf2_msgs::TFMessage;

use super::cameras::{CameraWishes, DepthCamera};
use super::topics::Role;
use crate::enu_transformer::ins::InsSource;

/// Wishes of the user; empty or `None` is "find out".
#[derive(Clone, Debug, Default)]
pub struct TopicWishes {
    /// Cloud topics.
    pub points: Vec<String>,
    /// Source of poses.
    pub source: Option<InsSource>,
    /// Topic of the INS.
    pub ins: Option<String>,
    /// Frame of the map.
    pub map_frame: Option<String>,
    /// Frame of the machine.
    pub base_frame: Option<String>,
    /// True to take poses of lidar odometry, whichever the log has; depth cameras are left out.
    pub lidar_odometry: bool,
    /// Streams of depth cameras.
    pub cameras: CameraWishes,
}

/// Roles by topic of the log, the source of poses, and the frames.
#[derive(Debug)]
pub struct TopicPlan {
    /// Role by index of the topic in the log.
    pub roles: BTreeMap<usize, Role>,
    /// Depth cameras whose images become clouds.
    pub cameras: Vec<DepthCamera>,
    /// Source of poses.
    pub source: InsSource,
    /// Frame of the map.
    pub map_frame: String,
    /// Frame of the machine.
    pub base_frame: String,
    /// Cloud topic whose scans give the poses, by lidar odometry: the log has no others.
    pub odometry: Option<usize>,
    /// Topic of a gyroscope for lidar odometry.
    pub imu: Option<usize>,
    /// Delay with which poses come late in the log, in nanoseconds.
    pub pose_delay_ns: i64,
    /// Static transforms that come after the first cloud, and hold from the beginning.
    pub late_statics: TFMessage,
    /// Topics taken and left out, a line each, for the user.
    pub choices: Vec<String>,
}

impl TopicPlan {
    /// Clouds of the log that are replayed.
    pub fn clouds(&self, bag: &BagReader) -> u64 {
        let topics = self.topics(bag, Role::is_cloud);
        topics.map(|topic| topic.message_count).sum()
    }

    /// Topics whose role is wanted.
    pub fn topics<'a>(
        &'a self,
        bag: &'a BagReader,
        wanted: impl Fn(Role) -> bool + 'a,
    ) -> impl Iterator<Item = &'a TopicInfo> + 'a {
        let topics = self.roles.iter().filter(move |(_, role)| wanted(**role));
        topics.filter_map(|(i, _)| bag.topics().get(*i))
    }

    /// Line for lidar odometry on scans in one plane.
    pub(super) fn planar_odometry(&self, bag: &BagReader) -> Option<String> {
        let topic = self.odometry?;
        let is_planar = |role: &Role| matches!(role, Role::Cloud(of) if of.is_planar());
        self.roles.get(&topic).filter(|role| is_planar(role))?;
        let name = bag.topics().get(topic).map(|topic| &topic.name)?;
        Some(format!(
            "{name} is of a planar scanner, which shows no height, roll or pitch: record odometry or /tf beside it"
        ))
    }

    /// Names of the topics with a role that is wanted.
    pub(super) fn names(&self, bag: &BagReader, wanted: impl Fn(Role) -> bool) -> Vec<String> {
        let topics = self.topics(bag, wanted);
        topics.map(|topic| topic.name.clone()).collect()
    }
}
