//! Forgetting voxels that are old.
//!
//! Those that beams pass through are cleared by [`crate::raycast::RayClearer`].

use thiserror::Error;

use super::VoxelList;

/// The list does not know when its points were seen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
#[error("the map keeps no stamps: make it with_payload(Payload {{ stamps: true, .. }})")]
pub struct NoStamps;

impl VoxelList {
    /// Removes the voxels whose last point is older than `stamp_ns`; gives their number.
    ///
    /// Voxels without a stamp, from lists that kept none, go too. Fails, changing nothing, if this
    /// list keeps no stamps.
    pub fn forget_before(&mut self, stamp_ns: i64) -> Result<usize, NoStamps> {
        if !self.payload.stamps {
            return Err(NoStamps);
        }
        Ok(self.remove_where(|shard, number, _| {
            let stamps = shard.columns.stamps.get(number);
            stamps.is_some_and(|stamps| stamps.last_ns < stamp_ns)
        }))
    }
}
