//! Options of writing map files, and limits of reading them.

/// Maximum ratio of the unpacked to the stored bytes of a section.
///
/// It bounds the memory that a small file can allocate; maps of surfaces stay far below.
pub const MAX_EXPANSION: u64 = 64;

/// Maximum number of voxels in a file of a given size.
pub fn max_voxels_of(file_bytes: u64) -> usize {
    usize::try_from(file_bytes.saturating_mul(MAX_EXPANSION)).unwrap_or(usize::MAX)
}

/// Log2 of the largest zstd window of a reader: that of level 19.
pub(super) const MAX_WINDOW_LOG: u32 = 23;

/// Options for writing a map.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct WriteOptions {
    /// Sections packed by zstd at this level, 1 to 19; stored as they are if `None`.
    pub zstd_level: Option<i32>,
    /// Leaves out counts, offset sums and all further columns.
    pub occupancy_only: bool,
}
