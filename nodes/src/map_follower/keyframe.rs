//! Keyframes: collection of their chunks, and adoption when they are complete.

use lattice_msgs::lattice::LatticeMap;

use super::followed::{FollowError, Followed};
use super::followed_map::FollowedMap;
use super::follower::{MapFollower, PATIENCE_S, check_chunk};
use super::incomplete::Staging;
use crate::convert::map::{self, Decoded, History};

impl MapFollower {
    /// Handles one chunk of a keyframe.
    pub fn on_map(&mut self, message: &LatticeMap) -> Result<Followed, FollowError> {
        check_chunk(message.chunk, message.chunks)?;
        if self.hurry.is_requested() {
            return Ok(Followed::LeftOut);
        }
        if message.voxels_total > self.max_voxels as u64 {
            self.too_large = Some(message.info.epoch);
            self.patience_s = PATIENCE_S[1];
            return Err(FollowError::TooLarge {
                found: message.voxels_total,
                limit: self.max_voxels,
            });
        }
        let voxels = map::voxels_from(message.into(), self.max_voxels)?;
        self.too_large = None;
        if self
            .map
            .as_ref()
            .is_some_and(|map| map.is_of(&message.info))
        {
            // Includes the rest of a keyframe whose chunks were repeated: it cannot become complete.
            if self.sequence.is_some_and(|at| message.sequence <= at) {
                return Ok(Followed::Old);
            }
        } else {
            self.begin_epoch(FollowedMap::empty(&message.info, message.offset_unit_m)?);
        }
        if let Some(map) = &mut self.map {
            map.frame_id.clone_from(&message.header.frame_id);
            map.stamp_ns = message.header.stamp.to_ns();
        }
        let history = History(message.history_checksum);
        let staging = match self.staging.take() {
            None => {
                // Updates that wait for a lost one are dropped: the keyframe makes them obsolete.
                self.open_updates.clear();
                Staging::new(message.sequence, history, message.chunks)
            }
            Some(staging)
                if (staging.sequence, staging.history, staging.chunks.expected)
                    == (message.sequence, history, message.chunks) =>
            {
                staging
            }
            Some(other) => other.restart(message.sequence, history, message.chunks),
        };
        self.stage(staging, message.chunk, voxels)
    }

    fn begin_epoch(&mut self, map: FollowedMap) {
        let old = self.map.replace(map);
        // An incomplete new map is not kept.
        if self.keeps_before && self.before.is_none() {
            self.before = old;
        }
        self.sequence = None;
        self.newest = 0;
        self.staging = None;
        self.open_updates.clear();
        self.touched.clear();
        self.replaced = true;
    }

    fn stage(
        &mut self,
        mut staging: Staging,
        chunk: u32,
        decoded: Decoded,
    ) -> Result<Followed, FollowError> {
        if staging.chunks.insert(chunk) {
            staging.voxels.extend(decoded.voxels);
            staging.colors.extend(decoded.colors);
        }
        if staging.voxels.len() > self.max_voxels {
            return Err(FollowError::TooLarge {
                found: staging.voxels.len() as u64,
                limit: self.max_voxels,
            });
        }
        self.newest = self.newest.max(staging.sequence);
        (staging.heard_at, self.quiet_s) = (self.newest, 0);
        if staging.chunks.complete() {
            return self.adopt(staging);
        } else {
            self.staging = Some(staging);
        }
        Ok(Followed::Applied)
    }

    /// Replaces the voxels by a complete keyframe, then applies the later updates.
    fn adopt(&mut self, done: Staging) -> Result<Followed, FollowError> {
        let Some(map) = &mut self.map else {
            return Ok(Followed::Applied);
        };
        if !map.replace(done.voxels, done.colors, &mut self.touched, &self.hurry) {
            return Ok(Followed::LeftOut);
        }
        self.compact_above = self.compact_above.max(2 * self.touched.len());
        if self.sequence.is_none_or(|at| done.sequence > at) {
            self.keyframe_ns = Some(map.stamp_ns);
            (self.sequence, self.history) = (Some(done.sequence), done.history);
            self.still_s = 0;
        }
        self.keyframe_needed = false;
        self.patience_s = PATIENCE_S[0];
        for changes in done.later.iter().filter(|c| c.sequence > done.sequence) {
            map.apply(changes, self.max_voxels, &mut self.touched)?;
        }
        Ok(match self.advance() {
            Ok(()) => Followed::Applied,
            Err(why) => self.differ(why),
        })
    }
}
