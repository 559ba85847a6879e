//! Clouds that wait for the poses that cover them.

use std::collections::VecDeque;
use std::sync::Arc;

use lattice_core::cloud::CloudError;
use lattice_msgs::sensor_msgs::PointCloud2;

use super::cloud_clocks::CloudClock;
use super::cloud_notes::CloudNotes;
use super::cloud_times::CloudTimes;
use super::options::TransformerOptions;
use crate::convert::cloud;

/// Cloud with a validated layout and the time of each point.
pub struct WaitingCloud {
    pub topic: Arc<str>,
    pub message: Arc<PointCloud2>,
    /// Frame without a leading slash.
    pub frame: String,
    pub stamp_ns: i64,
    /// Time of each point; `None` if all are measured at the stamp.
    pub times: Option<Vec<i64>>,
    /// Times of the earliest and the latest point, ns.
    pub first_ns: i64,
    pub last_ns: i64,
    /// Time of reception, ns.
    pub arrived_ns: i64,
    /// Clock state of its topic at the reception.
    pub clock: CloudClock,
    /// Newest pose at the reception.
    pub newest_pose_ns: Option<i64>,
}

impl WaitingCloud {
    pub fn new(
        topic: &str,
        message: Arc<PointCloud2>,
        arrived_ns: i64,
        options: &TransformerOptions,
        notes: &mut CloudNotes,
    ) -> Result<Self, CloudError> {
        let time = options.deskew.then_some(&options.time);
        let (max_points, offset_ns) = (options.max_cloud_points, options.time_offset_ns);
        let times = CloudTimes::read(topic, &message, max_points, time, offset_ns, notes)?;
        Ok(Self {
            topic: topic.into(),
            frame: message.header.frame_id.trim_start_matches('/').to_owned(),
            stamp_ns: times.stamp_ns,
            times: times.times_ns,
            first_ns: times.first_ns,
            last_ns: times.last_ns,
            arrived_ns,
            clock: CloudClock::default(),
            newest_pose_ns: None,
            message,
        })
    }

    fn bytes(&self) -> usize {
        cloud::bytes_of(&self.message) + self.times.as_ref().map_or(0, |times| times.len() * 8)
    }
}

/// Queue with limits of clouds and bytes; the oldest clouds are dropped when it is full.
pub struct Waiting {
    clouds: VecDeque<WaitingCloud>,
    bytes: usize,
    max_clouds: usize,
    max_bytes: usize,
}

impl Waiting {
    pub fn new(max_clouds: usize, max_bytes: usize) -> Self {
        Self {
            clouds: VecDeque::new(),
            bytes: 0,
            max_clouds: max_clouds.max(1),
            max_bytes,
        }
    }

    /// Sets the limit of clouds, at least 1, which applies from the next cloud on.
    pub fn set_max_clouds(&mut self, max_clouds: usize) {
        self.max_clouds = max_clouds.max(1);
    }

    /// Adds a cloud; returns the older ones dropped for it.
    pub fn push(&mut self, cloud: WaitingCloud) -> Vec<WaitingCloud> {
        self.bytes += cloud.bytes();
        self.clouds.push_back(cloud);
        let mut gone = Vec::new();
        while self.clouds.len() > self.max_clouds
            || (self.bytes > self.max_bytes && self.clouds.len() > 1)
        {
            gone.extend(self.take(0));
        }
        gone
    }

    pub fn get(&self, i: usize) -> Option<&WaitingCloud> {
        self.clouds.get(i)
    }

    pub fn take(&mut self, i: usize) -> Option<WaitingCloud> {
        let cloud = self.clouds.remove(i)?;
        self.bytes -= cloud.bytes();
        Some(cloud)
    }

    pub fn len(&self) -> usize {
        self.clouds.len()
    }
}
