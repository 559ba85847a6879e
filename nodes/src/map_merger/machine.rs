//! State machine of the merger, without I/O.

use std::collections::BTreeMap;

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::{ColorSum, LabelCount, Payload, Voxel, VoxelList};
use lattice_msgs::geographic_msgs::GeoPoint;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use serde::Serialize;

use super::options::{MergedLabels, MergerOptions};
use super::robot_map::RobotMap;
use crate::convert::{geometry, map};
use crate::hurry::{CELLS_SORTED, Hurry};
use crate::map_follower::{FollowError, Followed, MapFollower};

/// Counters of a merger.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct MergerCounts {
    /// Received map messages.
    pub messages_in: u64,
    /// Messages that were malformed, or of a map that is too large.
    pub messages_refused: u64,
    /// Restarts of a robot's map.
    pub shares_replaced: u64,
    /// Voxels rejected by a full list.
    pub voxels_list_full: u64,
    /// Voxels more than 2^20 cells from the datum.
    pub voxels_out_of_range: u64,
    /// Updates created.
    pub updates: u64,
    /// Keyframes created.
    pub keyframes: u64,
}

/// Follows the maps of several robots and sums them.
pub struct MapMerger {
    options: MergerOptions,
    robot_maps: Vec<RobotMap>,
    /// Changed cells that are not in an update yet, some more than once.
    waiting: Vec<MortonKey>,
    /// `None` before the first robot's map.
    union: Option<VoxelList>,
    origin: Option<GeoPoint>,
    epoch: u64,
    sequence: u64,
    history: map::History,
    counts: MergerCounts,
    hurry: Hurry,
}

impl MapMerger {
    /// Merger without maps; `epoch` distinguishes its map from earlier ones on the topic.
    pub fn new(options: MergerOptions, epoch: u64) -> Self {
        let robot_map = |_| RobotMap::new(MapFollower::new(options.max_voxels));
        Self {
            robot_maps: (0..options.robots.len()).map(robot_map).collect(),
            options,
            waiting: Vec::new(),
            union: None,
            origin: None,
            epoch,
            sequence: 0,
            history: map::History::default(),
            counts: MergerCounts::default(),
            hurry: Hurry::default(),
        }
    }

    /// Leaves keyframes out after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        let of_robots = self.robot_maps.into_iter();
        let hurried = of_robots.map(|robot_map| robot_map.hurried_by(hurry));
        self.robot_maps = hurried.collect();
        self.hurry = hurry.clone();
        self
    }

    /// Changes the options, except robots, frame, datum and labels.
    pub fn set_options(&mut self, options: MergerOptions) {
        let (max_voxels, chunk_bytes) = (options.max_voxels, options.chunk_bytes);
        for robot_map in &mut self.robot_maps {
            robot_map.follower.set_max_voxels(max_voxels);
        }
        self.options.max_voxels = max_voxels;
        self.options.chunk_bytes = chunk_bytes;
    }

    /// Handles a keyframe chunk of a robot.
    pub fn on_map(&mut self, robot: usize, chunk: &LatticeMap) -> Result<Followed, FollowError> {
        self.follow(robot, |follower| follower.on_map(chunk))
    }

    /// Handles an update chunk of a robot.
    pub fn on_update(
        &mut self,
        robot: usize,
        chunk: &LatticeMapUpdate,
    ) -> Result<Followed, FollowError> {
        self.follow(robot, |follower| follower.on_update(chunk))
    }

    fn follow(
        &mut self,
        robot: usize,
        message: impl FnOnce(&mut MapFollower) -> Result<Followed, FollowError>,
    ) -> Result<Followed, FollowError> {
        self.counts.messages_in += 1;
        let Some(robot_map) = self.robot_maps.get_mut(robot) else {
            return Ok(Followed::Old);
        };
        let followed = message(&mut robot_map.follower);
        self.counts.messages_refused += u64::from(followed.is_err());
        followed
    }

    /// Advances the timeout of incomplete messages; returns the robots whose keyframe is to be requested.
    pub fn check_keyframe_timeout(&mut self) -> Vec<usize> {
        let waiting = self.robot_maps.iter_mut().enumerate();
        let waiting = waiting
            .filter_map(|(i, robot_map)| robot_map.follower.check_keyframe_timeout().then_some(i));
        waiting.collect()
    }

    /// Changes of all robots since the last call, as one update.
    pub fn take_update(&mut self) -> Vec<LatticeMapUpdate> {
        self.take_update_until(&|| false)
    }

    /// As [`MapMerger::take_update`]; none if `is_over` becomes true before all changes are summed, and then they wait for the
    /// next one.
    pub fn take_update_until(&mut self, is_over: &dyn Fn() -> bool) -> Vec<LatticeMapUpdate> {
        for robot in 0..self.robot_maps.len() {
            self.admit(robot);
        }
        if !self.sum_up(is_over) {
            return Vec::new();
        }
        let Some(union) = &mut self.union else {
            return Vec::new();
        };
        let changes = union.take_changes();
        if changes.changed.is_empty() && changes.removed.is_empty() {
            return Vec::new();
        }
        let previous = self.sequence;
        self.sequence += 1;
        self.counts.updates += 1;
        let Some(union) = &self.union else {
            return Vec::new();
        };
        let mut messages = map::update(union, &changes, previous, &self.stamp());
        self.history = map::sign(&mut messages, self.history, self.sequence, union.len());
        messages
    }

    /// The whole map in self-contained chunks; empty before the first robot's map.
    pub fn keyframe(&mut self) -> Vec<LatticeMap> {
        let chunks = match &self.union {
            Some(union) => map::keyframe(union, &self.stamp()),
            None => Vec::new(),
        };
        self.counts.keyframes += u64::from(!chunks.is_empty());
        chunks
    }

    /// Adopts the lattice of the first robot's map, else checks compatibility with the merged one.
    fn admit(&mut self, robot: usize) {
        let options = &self.options;
        let Some(robot_map) = self.robot_maps.get_mut(robot) else {
            return;
        };
        let Some(followed) = robot_map.begun() else {
            return;
        };
        self.counts.shares_replaced += 1;
        if self.union.is_none() {
            let payload = Payload {
                labels: options.labels != MergedLabels::None,
                stamps: false,
                color: false,
            };
            let list = VoxelList::new(followed.lattice.clone(), options.datum_m, usize::MAX);
            self.union = list.ok().map(|list| list.with_payload(payload));
            self.origin = followed.info.has_origin.then_some(followed.info.origin);
        }
        let Some(union) = &self.union else {
            return;
        };
        let admitted = robot_map.admit(union, &options.map_frame, self.origin.as_ref());
        match admitted {
            Ok(origin) => self.origin = self.origin.or(origin),
            Err(refusal) => {
                let name = options.robots.get(robot).map_or("", String::as_str);
                log::warn!("the map of {name} is not merged: {refusal}");
            }
        }
    }

    /// Sums the cells that changed in any map; false if `is_over` becomes true before the end.
    fn sum_up(&mut self, is_over: &dyn Fn() -> bool) -> bool {
        let Some(union) = &mut self.union else {
            return true;
        };
        for robot_map in &mut self.robot_maps {
            self.counts.voxels_out_of_range += robot_map.take_changed(&mut self.waiting);
        }
        let mut labels = BTreeMap::new();
        // A part in ascending order finds neighbours near in memory; all cells take long to sort.
        for cells in self.waiting.chunks_mut(CELLS_SORTED) {
            if is_over() {
                return false;
            }
            cells.sort_unstable();
            let mut before = None;
            for &mut cell in cells {
                if before.replace(cell) == Some(cell) {
                    continue;
                }
                labels.clear();
                let mut sum = Voxel::default();
                for (robot, robot_map) in (0..).zip(&self.robot_maps) {
                    let robot = (self.options.labels == MergedLabels::Robots).then_some(robot);
                    robot_map.add_to(cell, &mut sum, &mut labels, robot);
                }
                let labels = labels.iter().map(|(label, count)| LabelCount {
                    label: *label,
                    count: *count,
                });
                let labels: Vec<_> = labels.collect();
                let has_room = union.len() < self.options.max_voxels || union.contains(cell);
                if !((sum.count == 0 || has_room)
                    && union.put(cell, &sum, &labels, ColorSum::default()))
                {
                    self.counts.voxels_list_full += 1;
                }
            }
        }
        self.waiting = Vec::new();
        !is_over()
    }

    /// Number of changed cells that are not in an update yet; some count more than once.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Voxels of the merged map, `None` before the first robot's map.
    pub fn list(&self) -> Option<&VoxelList> {
        self.union.as_ref()
    }

    /// Maps of the robots, in the order of the options.
    pub fn robot_maps(&self) -> &[RobotMap] {
        &self.robot_maps
    }

    /// Counters.
    pub fn counts(&self) -> &MergerCounts {
        &self.counts
    }

    fn stamp(&self) -> map::MapStamp<'_> {
        let stamps = self.robot_maps.iter().filter_map(RobotMap::stamp_ns);
        let newest_ns = stamps.max().unwrap_or(0);
        map::MapStamp {
            hurry: self.hurry.clone(),
            header: geometry::header(&self.options.map_frame, newest_ns),
            epoch: self.epoch,
            sequence: self.sequence,
            history: self.history,
            origin: self.origin.as_ref(),
            chunk_bytes: self.options.chunk_bytes,
        }
    }
}
