//! An open file of sqlite3.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{Arc, OnceLock},
};

use tempfile::TempPath;

use super::message_key::Key;
use super::salvage::Salvaged;
use crate::storage::StorageInfo;

/// An indexed SQLite file.
pub(crate) struct SqliteFile {
    pub(super) path: PathBuf,
    pub(super) temporary: Option<Arc<TempPath>>,
    pub(super) topic_of: Arc<BTreeMap<i64, usize>>,
    /// Readable messages in order of time, if damage prevents ordering by the database.
    pub(super) rescued: Option<Arc<Vec<Key>>>,
    /// Name of the index of times, if any.
    pub(super) time_index: Option<String>,
    /// True for a truncated file.
    pub(super) cut: bool,
    pub(super) salvaged: OnceLock<Arc<Salvaged>>,
    /// True if rows, which have no checksum, may be altered.
    pub(super) unchecked: bool,
    pub(crate) info: StorageInfo,
}
