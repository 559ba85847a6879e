//! Messages of an SQLite file in order of log time, in pages of keys.

use std::{collections::BTreeMap, collections::VecDeque, path::PathBuf, sync::Arc};

use rusqlite::{Connection, params};
use tempfile::TempPath;

use super::message_key::{KEY_COLUMNS, Key, key};
use super::{SqliteFile, connection::connect};
use crate::{
    BagError, MAX_MESSAGE_BYTES,
    storage::{Filter, StorageMessage},
};

/// Keys per query; more if each query has to sort the whole table.
const PAGE_KEYS: usize = 4096;
const PAGE_KEYS_UNSORTED: usize = 1 << 20;
/// Limit of recovered keys.
const MAX_RESCUED_KEYS: usize = 1 << 26;

/// Condition for an invalid message row, such as data shorter than a CDR header.
pub(super) const IMPLAUSIBLE: &str = "typeof(timestamp) <> 'integer' OR timestamp < 0 OR octet_length(data) IS NULL OR octet_length(data) < 4";

/// Keys of all rows before the first unreadable one.
pub(super) fn readable_keys(connection: &Connection) -> Vec<Key> {
    let select = format!("{KEY_COLUMNS} FROM messages NOT INDEXED ORDER BY id");
    let Ok(mut statement) = connection.prepare(&select) else {
        return Vec::new();
    };
    let Ok(rows) = statement.query_map([], key) else {
        return Vec::new();
    };
    rows.map_while(Result::ok).take(MAX_RESCUED_KEYS).collect()
}

pub(super) struct SqliteStream {
    connection: Connection,
    path: PathBuf,
    /// Keeps a decompressed copy alive.
    _temporary: Option<Arc<TempPath>>,
    topic_of: Arc<BTreeMap<i64, usize>>,
    filter: Filter,
    keys: VecDeque<Key>,
    /// Last key of the previous page.
    after: Option<(i64, i64)>,
    page_keys: usize,
    messages_read: u64,
    damages: VecDeque<BagError>,
    unchecked: bool,
}

impl SqliteStream {
    pub(super) fn new(file: &SqliteFile, filter: Filter) -> Result<SqliteStream, BagError> {
        let past_damage = filter.past_damage;
        let mut stream = SqliteStream {
            connection: connect(&file.path, file.access(filter.past_damage))?,
            path: file.path.clone(),
            _temporary: file.temporary.clone(),
            topic_of: file.topic_of.clone(),
            filter,
            keys: VecDeque::new(),
            after: None,
            page_keys: if file.time_index.is_some() {
                PAGE_KEYS
            } else {
                PAGE_KEYS_UNSORTED
            },
            messages_read: 0,
            damages: file.info.damage.iter().cloned().collect(),
            unchecked: file.unchecked,
        };
        let salvaged = past_damage.then(|| file.salvaged(&stream.connection));
        if let Some(salvaged) = &salvaged {
            stream.damages.extend(salvaged.damages(&file.path));
        }
        let salvaged = salvaged.as_ref().map(|salvaged| &salvaged.keys);
        if let Some(rescued) = salvaged.or(file.rescued.as_deref()) {
            stream.keys = rescued
                .iter()
                .filter(|key| stream.wants(key))
                .copied()
                .collect();
            // All keys are present: no page follows.
            stream.page_keys = 0;
        }
        Ok(stream)
    }

    fn wants(&self, key: &Key) -> bool {
        let is_message = key.timestamp_ns >= 0 && key.size_bytes >= 4;
        let topic = self.topic_of.get(&key.topic_id).filter(|_| is_message);
        topic.is_some_and(|topic| self.filter.wants(*topic, key.timestamp_ns))
    }

    /// Fetches keys until some are selected or none are left.
    fn fetch_keys(&mut self) -> Result<(), BagError> {
        let select = format!(
            "{KEY_COLUMNS} FROM messages WHERE timestamp >= ?1 AND (timestamp, id) > (?1, ?2) AND timestamp <= ?3 \
             ORDER BY timestamp, id LIMIT ?4"
        );
        while self.keys.is_empty() && self.page_keys > 0 {
            let position = format!("message {}", self.messages_read);
            let wrong = |e| BagError::sqlite(&self.path, &position, e);
            let end_ns = self.filter.end_ns;
            let last_ns = end_ns.map_or(i64::MAX, |end_ns| end_ns.saturating_sub(1));
            let page: Vec<Key> = {
                let mut statement = self.connection.prepare_cached(&select).map_err(wrong)?;
                // Before the first page every row of the start time matches, with any id.
                let (time_ns, id) = self.after.unwrap_or((self.filter.start_ns, i64::MIN));
                let limit = i64::try_from(self.page_keys).unwrap_or(i64::MAX);
                let rows = statement
                    .query_map(params![time_ns, id, last_ns, limit], key)
                    .map_err(wrong)?;
                rows.collect::<Result<_, _>>().map_err(wrong)?
            };
            match page.last() {
                Some(last) => self.after = Some((last.timestamp_ns, last.id)),
                None => self.page_keys = 0,
            }
            self.keys = page.into_iter().filter(|key| self.wants(key)).collect();
        }
        Ok(())
    }

    fn read(&mut self, key: Key) -> Result<StorageMessage, BagError> {
        let position = || format!("message {} (row {})", self.messages_read, key.id);
        if key.size_bytes > MAX_MESSAGE_BYTES {
            return Err(BagError::TooLarge {
                path: self.path.clone(),
                what: "a message",
                position: position(),
                size_bytes: key.size_bytes,
                limit_bytes: MAX_MESSAGE_BYTES,
                remedy: "delete the row, or leave its topic out",
            });
        }
        let wrong = |e| BagError::sqlite(&self.path, position(), e);
        let data = {
            let select = "SELECT CAST(data AS BLOB) FROM messages WHERE id = ?1";
            let mut statement = self.connection.prepare_cached(select).map_err(wrong)?;
            statement
                .query_row([key.id], |row| row.get::<_, Vec<u8>>(0))
                .map_err(wrong)?
        };
        let topic = self
            .topic_of
            .get(&key.topic_id)
            .copied()
            .unwrap_or(usize::MAX);
        self.messages_read += 1;
        Ok(StorageMessage {
            topic,
            log_time_ns: key.timestamp_ns,
            unchecked: self.unchecked,
            data,
        })
    }
}

impl Iterator for SqliteStream {
    type Item = Result<StorageMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = match self.fetch_keys() {
            Ok(()) => self.keys.pop_front().map(|key| self.read(key)),
            Err(error) => {
                self.page_keys = 0;
                Some(Err(error))
            }
        };
        match next {
            Some(Err(error)) if !self.filter.past_damage => {
                Some(Err(self.damages.pop_front().unwrap_or(error)))
            }
            Some(message) => Some(message),
            None => self.damages.pop_front().map(Err),
        }
    }
}
