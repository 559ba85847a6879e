//! The followed map of the robot.

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};

use super::output::Output;
use super::state::SemanticIcpServer;
use crate::hurry::Hurry;
use crate::map_follower::{FollowError, Followed};

impl SemanticIcpServer {
    /// Leaves keyframes out after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.follower = self.follower.hurried_by(hurry);
        self
    }

    /// Handles one keyframe chunk of the map.
    pub fn on_map(&mut self, message: &LatticeMap, now_ns: i64) -> Vec<Output> {
        let followed = self.follower.on_map(message);
        self.followed(followed, now_ns)
    }

    /// Handles one update chunk of the map.
    pub fn on_map_update(&mut self, message: &LatticeMapUpdate, now_ns: i64) -> Vec<Output> {
        let followed = self.follower.on_update(message);
        self.followed(followed, now_ns)
    }

    fn followed(&mut self, followed: Result<Followed, FollowError>, now_ns: i64) -> Vec<Output> {
        let mut out = Vec::new();
        match followed {
            Ok(Followed::NeedKeyframe) => out.push(Output::NeedKeyframe),
            Ok(_) => {}
            Err(error) => {
                log::debug!("map message rejected: {error}");
                self.counts.map_refused += 1;
            }
        }
        let (_, replaced) = self.follower.take_touched();
        self.reset_label_confusion |= replaced;
        if replaced && self.prepared.is_some() {
            // Its frame may differ.
            self.forget("the map is a new one", now_ns, &mut out);
        }
        out
    }

    /// Requests a keyframe if an incomplete one has timed out. To be called once a second.
    pub fn check_keyframe_timeout(&mut self) -> Option<Output> {
        let overdue = self.follower.check_keyframe_timeout();
        overdue.then_some(Output::NeedKeyframe)
    }

    /// Number of detected differences from the mapper's map.
    pub fn map_differences(&self) -> u64 {
        self.follower.differences()
    }
}
