//! Follower of one map: keyframes and updates that follow each other.

use std::collections::BTreeMap;

use lattice_core::lattice::MortonKey;
use lattice_msgs::lattice::LatticeMapUpdate;

use super::followed::{FollowError, Followed};
use super::followed_map::{Changes, FollowedMap};
use super::incomplete::{Chunks, MAX_WAITING_UPDATES, OpenUpdate, Staging};
use crate::convert::map::{History, MapMessageError};
use crate::hurry::Hurry;

/// Limit of chunks per keyframe or update.
const MAX_CHUNKS: u32 = 1 << 16;
/// Updates without a chunk after which the rest of a keyframe counts as lost.
const MAX_STAGING_UPDATES: u64 = 10;
/// Consecutive updates older than the map after which it counts as another mapper's: more than are queued while a
/// keyframe is processed.
const MAX_OLD_UPDATES: u32 = 128;
/// Longest delay of an update that a later update or keyframe has overtaken, s.
const MAX_OVERTAKEN_S: u32 = 5;
/// Touched keys that may be kept with repetitions: half a megabyte.
const COMPACT_ABOVE: usize = 1 << 16;
/// Seconds without a chunk after which the rest of a keyframe counts as lost, initially and at most: a
/// mapper with a long update period must not receive repeated requests.
pub(super) const PATIENCE_S: [u32; 2] = [2, 64];

/// Follower of one map and its two topics.
pub struct MapFollower {
    pub(super) max_voxels: usize,
    pub(super) map: Option<FollowedMap>,
    /// Map of an earlier epoch until it is taken, if it is kept.
    pub(super) before: Option<FollowedMap>,
    pub(super) keeps_before: bool,
    /// Sequence of the voxels; `None` until the first keyframe of an epoch is complete.
    pub(super) sequence: Option<u64>,
    /// Checksum of the updates up to that sequence.
    pub(super) history: History,
    /// Number of detected differences from the mapper's map.
    differences: u64,
    /// Consecutive old updates.
    old_updates: u32,
    /// Stamp of the last applied keyframe, until an update follows it.
    pub(super) keyframe_ns: Option<i64>,
    /// Seconds since the last change of the sequence.
    pub(super) still_s: u32,
    /// Newest sequence of any message of the epoch.
    pub(super) newest: u64,
    pub(super) staging: Option<Staging>,
    pub(super) open_updates: BTreeMap<u64, OpenUpdate>,
    pub(super) touched: Vec<MortonKey>,
    /// Number of touched keys above which repeated ones are left out.
    pub(super) compact_above: usize,
    pub(super) replaced: bool,
    /// A keyframe is needed and has not arrived.
    pub(super) keyframe_needed: bool,
    /// Epoch of a map above the size limit: further requests are useless.
    pub(super) too_large: Option<u64>,
    pub(super) quiet_s: u32,
    pub(super) patience_s: u32,
    pub(super) hurry: Hurry,
}

impl MapFollower {
    /// An empty follower that keeps at most `max_voxels`.
    pub fn new(max_voxels: usize) -> Self {
        Self {
            max_voxels,
            map: None,
            before: None,
            keeps_before: false,
            sequence: None,
            history: History::default(),
            differences: 0,
            old_updates: 0,
            keyframe_ns: None,
            still_s: 0,
            newest: 0,
            staging: None,
            open_updates: BTreeMap::new(),
            touched: Vec::new(),
            compact_above: COMPACT_ABOVE,
            replaced: false,
            keyframe_needed: false,
            too_large: None,
            quiet_s: 0,
            patience_s: PATIENCE_S[0],
            hurry: Hurry::default(),
        }
    }

    /// Leaves keyframes out after `hurry`.
    pub fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.hurry = hurry.clone();
        self
    }

    /// Keeps the map of an epoch that ends until it is taken.
    pub fn keeping_before(mut self) -> Self {
        self.keeps_before = true;
        self
    }

    /// Map of the first epoch that has ended since [`MapFollower::take_before`], if it is kept.
    pub fn before(&self) -> Option<&FollowedMap> {
        self.before.as_ref()
    }

    /// Map of the first epoch that has ended since the last call, if it is kept.
    pub fn take_before(&mut self) -> Option<FollowedMap> {
        self.before.take()
    }

    /// Changes the voxel limit; a larger map stays until its next message.
    pub fn set_max_voxels(&mut self, max_voxels: usize) {
        if max_voxels > self.max_voxels {
            self.too_large = None;
        }
        self.max_voxels = max_voxels;
    }

    /// The current map.
    pub fn map(&self) -> Option<&FollowedMap> {
        self.map.as_ref()
    }

    /// Sequence of the map; `None` before the first keyframe of an epoch is complete.
    pub fn sequence(&self) -> Option<u64> {
        self.sequence
    }

    /// Number of detected differences from the mapper's map, each with a keyframe request.
    pub fn differences(&self) -> u64 {
        self.differences
    }

    /// Keys of voxels added, changed or removed since the last call, some more than once, and true if lattice,
    /// epoch or datum are new (then all of the old map is obsolete).
    pub fn take_touched(&mut self) -> (Vec<MortonKey>, bool) {
        self.compact_above = COMPACT_ABOVE;
        (
            std::mem::take(&mut self.touched),
            std::mem::take(&mut self.replaced),
        )
    }

    /// Handles one chunk of an update.
    pub fn on_update(&mut self, message: &LatticeMapUpdate) -> Result<Followed, FollowError> {
        check_chunk(message.chunk, message.chunks)?;
        let info = &message.info;
        let is_known =
            |map: &FollowedMap| map.info.epoch == info.epoch && map.info.lattice == info.lattice;
        let begun = self.sequence.is_some() || self.staging.is_some();
        let Some(map) = self.map.as_mut().filter(|map| begun && is_known(map)) else {
            return Ok(match self.too_large == Some(info.epoch) {
                true => Followed::Old,
                false => self.need_keyframe(),
            });
        };
        // The geodetic origin may become known after the map has begun.
        map.info.origin = info.origin;
        map.info.has_origin = info.has_origin;
        let history = History(message.history_checksum);
        if let Some(at) = self.sequence.filter(|at| message.sequence <= *at) {
            // The same sequence with other content, or many old updates in a row:
            // the current map is of another mapper.
            self.old_updates += 1;
            // A newer stamp than that of the keyframe it should precede means the same.
            let stamp_ns = message.header.stamp.to_ns();
            let is_other = message.sequence == at && history != self.history
                || self.still_s > MAX_OVERTAKEN_S
                || self.keyframe_ns.is_some_and(|at_ns| stamp_ns > at_ns);
            return Ok(match is_other || self.old_updates > MAX_OLD_UPDATES {
                true => self.differ("an update of another history"),
                false => Followed::Old,
            });
        }
        self.old_updates = 0;
        let lost = self
            .sequence
            .is_none_or(|at| message.previous_sequence > at)
            && !self.open_updates.contains_key(&message.sequence)
            && self.staging.is_none();
        let changes = Changes::of(message, self.max_voxels)?;
        let sum = changes.sum;
        // Updates are applied only after the first keyframe is complete.
        if self.sequence.is_some() {
            map.apply(&changes, self.max_voxels, &mut self.touched)?;
            self.compact();
        }
        if let Some(staging) = &mut self.staging
            && !staging.keep(changes, self.max_voxels)
        {
            self.staging = None;
            return Ok(self.need_keyframe());
        }
        self.newest = self.newest.max(message.sequence);
        let open = self
            .open_updates
            .entry(message.sequence)
            .or_insert_with(|| OpenUpdate {
                previous: message.previous_sequence,
                chunks: Chunks::new(message.chunks),
                sum: 0,
                history,
                voxels_total: message.voxels_total,
            });
        if open.chunks.insert(message.chunk) {
            open.sum = open.sum.wrapping_add(sum);
        }
        self.quiet_s = 0;
        if let Err(why) = self.advance() {
            return Ok(self.differ(why));
        }
        if let Some(staging) = &self.staging {
            // A keyframe older than the updated map is obsolete.
            if self.sequence.is_some_and(|at| staging.sequence <= at) {
                self.staging = None;
            } else if self.newest.saturating_sub(staging.heard_at) > MAX_STAGING_UPDATES {
                return Ok(self.need_keyframe());
            }
        }
        if self.open_updates.len() > MAX_WAITING_UPDATES {
            self.open_updates.clear();
            return Ok(self.need_keyframe());
        }
        Ok(if lost {
            self.need_keyframe()
        } else {
            Followed::Applied
        })
    }

    /// Advances the timeout of incomplete messages; true if a keyframe is to be requested because
    /// no chunk has arrived. To be called once a second.
    pub fn check_keyframe_timeout(&mut self) -> bool {
        self.still_s = self.still_s.saturating_add(1);
        let incomplete = self.staging.is_some() || !self.open_updates.is_empty();
        if !incomplete && !self.keyframe_needed {
            return false;
        }
        self.quiet_s += 1;
        let overdue = self.quiet_s > self.patience_s;
        if overdue {
            self.quiet_s = 0;
            self.patience_s = (2 * self.patience_s).min(PATIENCE_S[1]);
        }
        overdue
    }

    /// Leaves out touched keys that are repeated, once they have doubled: a chunk may come any number of times.
    fn compact(&mut self) {
        if self.touched.len() > self.compact_above {
            self.touched.sort_unstable();
            self.touched.dedup();
            self.compact_above = COMPACT_ABOVE.max(2 * self.touched.len());
        }
    }

    fn need_keyframe(&mut self) -> Followed {
        self.keyframe_needed = true;
        Followed::NeedKeyframe
    }

    /// Restarts after a difference from the mapper's map; the map stays visible until the next keyframe.
    pub(super) fn differ(&mut self, why: &str) -> Followed {
        self.differences += 1;
        log::warn!("the map differs from its mapper's ({why}): requesting a keyframe");
        (self.sequence, self.keyframe_ns) = (None, None);
        (self.newest, self.old_updates) = (0, 0);
        self.staging = None;
        self.open_updates.clear();
        self.need_keyframe()
    }

    /// Advances the sequence over all complete consecutive updates; an error if
    /// a checksum does not match.
    pub(super) fn advance(&mut self) -> Result<(), &'static str> {
        let Some(at) = &mut self.sequence else {
            return Ok(());
        };
        while let Some(entry) = self.open_updates.first_entry() {
            let open = entry.get();
            let sequence = *entry.key();
            let follows = open.previous <= *at && open.chunks.complete();
            if sequence > *at && !follows {
                break;
            }
            let open = entry.remove();
            if sequence <= *at {
                continue;
            }
            self.keyframe_ns = None;
            self.history = self.history.then(sequence, open.sum);
            *at = sequence;
            self.still_s = 0;
            if self.history != open.history {
                return Err("other updates");
            }
            // Later updates have been applied already.
            let voxels = self.map.as_ref().map_or(0, |map| map.voxels().len()) as u64;
            if self.open_updates.is_empty() && voxels != open.voxels_total {
                return Err("other voxels");
            }
        }
        Ok(())
    }
}

pub(super) fn check_chunk(chunk: u32, chunks: u32) -> Result<(), MapMessageError> {
    let is_one = chunk < chunks && chunks <= MAX_CHUNKS;
    let ok = is_one.then_some(());
    ok.ok_or(MapMessageError::Chunk { chunk, chunks })
}
