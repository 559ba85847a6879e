//! An open MCAP file.

use std::{path::PathBuf, sync::Arc};

use tempfile::TempPath;

use super::contents::{Block, Routes};
use crate::{BagError, storage::StorageInfo};

/// An indexed MCAP file.
pub(crate) struct McapFile {
    pub(super) path: PathBuf,
    pub(super) temporary: Option<Arc<TempPath>>,
    pub(super) blocks: Vec<Block>,
    pub(super) topic_of: Arc<Routes>,
    pub(super) damages: Vec<BagError>,
    /// True if messages outside of chunks, which have no checksum, may be altered.
    pub(super) unchecked: bool,
    /// Number of messages by the summary, if readable.
    pub(crate) claimed: Option<u64>,
    pub(crate) info: StorageInfo,
}
