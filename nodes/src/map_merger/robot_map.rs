//! Map of one robot as part of the merged map.

use std::collections::BTreeMap;

use lattice_core::lattice::MortonKey;
use lattice_core::registration::UNLABELED;
use lattice_core::voxels::{OFFSET_UNIT_M, Voxel, VoxelList};
use lattice_msgs::geographic_msgs::GeoPoint;
use rustc_hash::FxHashSet;
use thiserror::Error;

use crate::hurry::Hurry;
use crate::map_follower::{FollowedMap, MapFollower};

/// Tolerance of a datum's distance from a lattice point of the merged map, in cell sizes.
const DATUM_SLACK: f64 = 1e-6;

/// Reason why a robot's map is not merged.
#[derive(Clone, PartialEq, Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum Refusal {
    /// Another frame.
    #[error("it is in frame '{found}', the merged one in '{expected}'")]
    Frame { found: String, expected: String },
    /// Other cells.
    #[error("it is of {found}, the merged one of {expected}")]
    Lattice { found: String, expected: String },
    /// Another origin.
    #[error(
        "its origin is {found:?} (latitude, longitude, height), that of the merged one {expected:?}"
    )]
    Origin { found: [f64; 3], expected: [f64; 3] },
    /// Lattice points between those of the merged map.
    #[error("its datum {datum_m:?} m is {off_m} m from the next lattice point of the merged one")]
    Datum { datum_m: [f64; 3], off_m: f64 },
}

/// Map of one robot and its offset in the merged map.
pub struct RobotMap {
    pub(super) follower: MapFollower,
    /// Lattice index of its datum minus that of the merged map; `None` if it is not merged.
    shift: Option<[i64; 3]>,
    /// Epoch of the shift.
    epoch: Option<u64>,
    refusal: Option<Refusal>,
    /// Merged cells of its map before this epoch, which are to be summed again.
    obsolete: Vec<MortonKey>,
    /// True if all cells are to be summed again.
    anew: bool,
    /// Keys of its voxels out of the range of the merged map.
    out_of_range: FxHashSet<MortonKey>,
    /// Ratio of its offset unit to that of the sums.
    unit: f64,
}

impl RobotMap {
    pub(super) fn new(follower: MapFollower) -> Self {
        Self {
            follower: follower.keeping_before(),
            shift: None,
            epoch: None,
            refusal: None,
            obsolete: Vec::new(),
            anew: false,
            out_of_range: FxHashSet::default(),
            unit: 1.0,
        }
    }

    /// Leaves keyframes out after `hurry`.
    pub(super) fn hurried_by(mut self, hurry: &Hurry) -> Self {
        self.follower = self.follower.hurried_by(hurry);
        self
    }

    /// Number of its voxels in the merged map.
    pub fn voxels(&self) -> usize {
        let map = self.map().filter(|_| self.shift.is_some());
        let all = map.map_or(0, |map| map.voxels().len());
        all.saturating_sub(self.out_of_range.len())
    }

    /// Reason why it is not merged.
    pub fn refusal(&self) -> Option<&Refusal> {
        self.refusal.as_ref()
    }

    /// Stamp of its newest message.
    pub(super) fn stamp_ns(&self) -> Option<i64> {
        self.shift.and(self.follower.map()).map(|map| map.stamp_ns)
    }

    /// Map of its epoch: the previous one until a new one is complete.
    fn map(&self) -> Option<&FollowedMap> {
        let maps = self
            .follower
            .map()
            .into_iter()
            .chain(self.follower.before());
        let mut own = maps.filter(|map| Some(map.info.epoch) == self.epoch);
        own.next()
    }

    /// Map of the robot, if it is complete and its epoch was not admitted yet.
    pub(super) fn begun(&self) -> Option<&FollowedMap> {
        self.follower.sequence()?;
        let map = self.follower.map()?;
        (self.epoch != Some(map.info.epoch)).then_some(map)
    }

    /// Merges its map from now on, or returns the reason against it; returns its origin. Its earlier
    /// contribution is removed.
    pub(super) fn admit(
        &mut self,
        union: &VoxelList,
        frame: &str,
        origin: Option<&GeoPoint>,
    ) -> Result<Option<GeoPoint>, Refusal> {
        let before = self.follower.take_before();
        let Some(map) = self.follower.map() else {
            return Ok(None);
        };
        if let (Some(before), Some(shift)) = (before, self.shift) {
            let cells = before.voxels().keys();
            self.obsolete
                .extend(cells.filter_map(|key| shifted(*key, shift)));
        }
        self.epoch = Some(map.info.epoch);
        self.anew = true;
        self.out_of_range.clear();
        self.unit = map.offset_unit_m / OFFSET_UNIT_M;
        let place = place(map, union, frame, origin);
        self.shift = place.as_ref().ok().copied();
        self.refusal = place.as_ref().err().cloned();
        place.map(|_| map.info.has_origin.then_some(map.info.origin))
    }

    /// Appends the merged cells that may have changed; returns the number out of range.
    pub(super) fn take_changed(&mut self, cells: &mut Vec<MortonKey>) -> u64 {
        // The old map stays merged until a new one is complete.
        let known = self.follower.map().map(|map| map.info.epoch);
        if self.epoch.is_none() || known != self.epoch {
            return 0;
        }
        let (touched, _) = self.follower.take_touched();
        cells.append(&mut self.obsolete);
        let (Some(map), Some(shift)) = (self.follower.map(), self.shift) else {
            return 0;
        };
        let mut out_of_range = 0;
        let change = |key| match shifted(key, shift) {
            Some(cell) => cells.push(cell),
            None => {
                out_of_range += 1;
                match map.voxels().contains_key(&key) {
                    true => self.out_of_range.insert(key),
                    false => self.out_of_range.remove(&key),
                };
            }
        };
        match std::mem::take(&mut self.anew) {
            true => map.voxels().keys().copied().for_each(change),
            false => touched.into_iter().for_each(change),
        }
        out_of_range
    }

    /// Adds its voxel to a cell of the merged map; all points have the label `robot` if given.
    pub(super) fn add_to(
        &self,
        cell: MortonKey,
        sum: &mut Voxel,
        labels: &mut BTreeMap<u16, u32>,
        robot: Option<u16>,
    ) {
        let own = self.shift.map(|shift| shift.map(i64::wrapping_neg));
        let own = own.and_then(|back| shifted(cell, back));
        let Some(voxel) = own
            .zip(self.map())
            .and_then(|(own, map)| map.voxels().get(&own))
        else {
            return;
        };
        sum.count = sum.count.saturating_add(voxel.count);
        for (sum, mean) in sum.sum.iter_mut().zip(voxel.mean_offset) {
            let offsets = f64::from(voxel.count) * f64::from(mean) * self.unit;
            *sum = sum.saturating_add(offsets.round() as i64);
        }
        let (label, points) = match robot {
            Some(robot) => (robot, voxel.count),
            None => (voxel.label, voxel.label_count),
        };
        if label != UNLABELED && points > 0 {
            let count = labels.entry(label).or_default();
            *count = count.saturating_add(points);
        }
    }
}

fn place(
    map: &FollowedMap,
    union: &VoxelList,
    frame: &str,
    origin: Option<&GeoPoint>,
) -> Result<[i64; 3], Refusal> {
    let found = map.frame_id.trim_start_matches('/');
    if found != frame {
        return Err(Refusal::Frame {
            found: found.chars().take(64).collect(),
            expected: frame.to_owned(),
        });
    }
    if map.lattice != *union.lattice() {
        return Err(Refusal::Lattice {
            found: format!("{:?}", map.lattice),
            expected: format!("{:?}", union.lattice()),
        });
    }
    let numbers = |at: &GeoPoint| [at.latitude, at.longitude, at.altitude];
    let own = map.info.has_origin.then_some(&map.info.origin);
    if let (Some(own), Some(origin)) = (own, origin)
        && own != origin
    {
        return Err(Refusal::Origin {
            found: numbers(own),
            expected: numbers(origin),
        });
    }
    let index = union.lattice().quantize_wide(&map.datum_m);
    let index = index.unwrap_or([i64::MAX; 3]);
    let off_m = (union.lattice().center_wide(index) - map.datum_m).norm();
    // NaN is rejected too.
    let on = off_m <= DATUM_SLACK * union.lattice().cell_side_m();
    if !on {
        let datum_m = map.datum_m.into();
        return Err(Refusal::Datum { datum_m, off_m });
    }
    let datum = union.datum_index();
    Ok([0, 1, 2].map(|i: usize| index[i].saturating_sub(datum[i])))
}

fn shifted(key: MortonKey, shift: [i64; 3]) -> Option<MortonKey> {
    let w = key.unpack();
    let moved = [0, 1, 2].map(|i: usize| {
        let index = i64::from(w[i]).checked_add(shift[i])?;
        i32::try_from(index).ok()
    });
    match moved {
        [Some(x), Some(y), Some(z)] => MortonKey::pack([x, y, z]),
        _ => None,
    }
}
