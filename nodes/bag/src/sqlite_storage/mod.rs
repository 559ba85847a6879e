//! SQLite storage files of every rosbag2 schema, opened without writing files beside them.

mod connection;
mod file;
mod message_key;
mod salvage;
mod stream;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
    sync::{Arc, OnceLock},
};

use rusqlite::Connection;
use tempfile::TempPath;

use super::{
    BagError, TopicInfo,
    storage::{Filter, StorageInfo, StorageStream, full_type_name, lenient_qos},
    topic::absolute_name,
};
use connection::{Access, connect, mended_magic, missing_pages};
pub(crate) use file::SqliteFile;
use salvage::{Salvaged, salvage};
use stream::{IMPLAUSIBLE, SqliteStream};

/// Limit of topics.
const MAX_TOPICS: usize = 65_536;
/// Limit of topics queried individually in a damaged table.
const MAX_DAMAGED_TOPICS: i64 = 4096;

impl SqliteFile {
    /// Opens `path`, which may be a temporary copy that is deleted with the last reader.
    pub(crate) fn open(
        path: &Path,
        temporary: Option<Arc<TempPath>>,
    ) -> Result<SqliteFile, BagError> {
        let mended = mended_magic(path)?;
        let mut path = mended.as_deref().map_or(path, |copy| copy);
        let mut temporary = mended.clone().or(temporary);
        let cut = missing_pages(path)?;
        if let Some(cut) = &cut {
            temporary = Some(cut.whole_pages(path)?);
        }
        let copied = temporary.clone().filter(|_| cut.is_some());
        path = copied.as_deref().map_or(path, |copy| copy);
        let missing_pages = cut.map(|cut| cut.damage);
        let access = match missing_pages {
            Some(_) => Access::Cut,
            None => Access::Strict,
        };
        let connection = connect(path, access)?;
        let mut file = SqliteFile {
            path: path.to_path_buf(),
            temporary,
            topic_of: Arc::default(),
            rescued: None,
            time_index: None,
            cut: missing_pages.is_some(),
            salvaged: OnceLock::new(),
            unchecked: false,
            info: StorageInfo::default(),
        };
        let cut = |error: BagError| missing_pages.clone().unwrap_or(error);
        if let Err(error) = file.read_topics(&connection) {
            file.info.topics.clear();
            let lenient = connect(path, Access::Damaged)?;
            file.read_topics(&lenient).map_err(|_| cut(error.clone()))?;
            log::warn!("{error}");
        }
        match (missing_pages.clone(), file.read_range(&connection)) {
            (None, Ok(())) => {}
            (None, Err(error)) => file.rescue(&connection, error),
            (Some(damage), _) => file.rescue(&connection, damage),
        }
        Ok(file)
    }

    /// Notes the damage of the compressed file of which this is the sound part.
    pub(crate) fn note_damage(&mut self, damage: BagError) {
        self.info.damage = Some(damage);
        self.unchecked = true;
    }

    /// Selected messages in order of log time.
    pub(crate) fn stream(&self, filter: Filter) -> Result<StorageStream, BagError> {
        Ok(Box::new(SqliteStream::new(self, filter)?))
    }

    /// Number of messages in the file, if known from the rows or their index.
    pub(crate) fn claimed(&self) -> Option<u64> {
        let connection = connect(&self.path, self.access(true)).ok()?;
        self.salvaged(&connection).claimed()
    }

    /// Readable messages after damage, searched once.
    fn salvaged(&self, connection: &Connection) -> Arc<Salvaged> {
        let search = || {
            let bytes = fs::metadata(&self.path).map_or(0, |examined| examined.len());
            Arc::new(salvage(connection, self.time_index.as_deref(), bytes))
        };
        self.salvaged.get_or_init(search).clone()
    }

    fn access(&self, past_damage: bool) -> Access {
        match (self.cut, past_damage) {
            (_, true) => Access::Damaged,
            (true, false) => Access::Cut,
            (false, false) => Access::Strict,
        }
    }

    fn read_topics(&mut self, connection: &Connection) -> Result<(), BagError> {
        let wrong = |e| BagError::sqlite(&self.path, "its list of tables", e);
        let tables = names(
            connection,
            "SELECT name FROM sqlite_master WHERE type = 'table'",
        )
        .map_err(wrong)?;
        if !tables.contains("topics") || !tables.contains("messages") {
            return Err(BagError::Foreign {
                path: self.path.clone(),
                found: format!(
                    "a SQLite database without the tables topics and messages (it has {tables:?})"
                ),
                remedy: "give the .db3 file of a rosbag2 bag",
            });
        }
        let definitions = self
            .definitions(connection, &tables)
            .unwrap_or_else(|error| {
                log::warn!("{error}; its topics have no definitions");
                BTreeMap::new()
            });
        let wrong = |e| BagError::sqlite(&self.path, "table topics", e);
        let columns =
            names(connection, "SELECT name FROM pragma_table_info('topics')").map_err(wrong)?;
        let column = |name| match columns.contains(name) {
            true => name,
            false => "''",
        };
        let (qos, hash) = (
            column("offered_qos_profiles"),
            column("type_description_hash"),
        );
        let select = format!(
            "SELECT id, name, type, serialization_format, {qos}, {hash} FROM topics NOT INDEXED \
             WHERE id BETWEEN ?1 AND ?2 ORDER BY id LIMIT {MAX_TOPICS}"
        );
        let mut statement = connection.prepare(&select).map_err(wrong)?;
        let named = |row: &rusqlite::Row<'_>| {
            let text = |i: usize| {
                let text = row.get::<_, Option<String>>(i);
                text.map(Option::unwrap_or_default)
            };
            let topic = TopicInfo {
                name: absolute_name(&text(1)?),
                type_name: full_type_name(&text(2)?),
                serialization_format: text(3)?,
                type_hash: text(5)?,
                ..TopicInfo::default()
            };
            Ok((row.get::<_, i64>(0)?, topic, text(4)?))
        };
        let mut read = |first: i64, last: i64| -> Result<Vec<_>, rusqlite::Error> {
            statement.query_map([first, last], named)?.collect()
        };
        let rows = read(i64::MIN, i64::MAX).or_else(|error| {
            // Individually: rosbag2 numbers them from one.
            let each = (1..=MAX_DAMAGED_TOPICS).filter_map(|id| read(id, id).ok());
            let found: Vec<_> = each.flatten().collect();
            match found.is_empty() {
                true => Err(error),
                false => Ok(found),
            }
        });
        let mut topic_of = BTreeMap::new();
        for (id, mut topic, qos) in rows.map_err(wrong)? {
            topic.offered_qos = lenient_qos(&topic.name, &qos);
            topic.definition = definitions.get(&topic.type_name).cloned();
            topic_of.insert(id, self.info.topics.len());
            self.info.topics.push(topic);
        }
        self.topic_of = Arc::new(topic_of);
        let indexed = "SELECT l.name FROM pragma_index_list('messages') AS l, pragma_index_info(l.name) AS i \
                       WHERE i.seqno = 0 AND i.name = 'timestamp'";
        self.time_index = names(connection, indexed)
            .ok()
            .and_then(|found| found.into_iter().next());
        Ok(())
    }

    fn definitions(
        &self,
        connection: &Connection,
        tables: &BTreeSet<String>,
    ) -> Result<BTreeMap<String, String>, BagError> {
        if !tables.contains("message_definitions") {
            return Ok(BTreeMap::new());
        }
        let wrong = |e| BagError::sqlite(&self.path, "table message_definitions", e);
        let select = "SELECT topic_type, encoded_message_definition FROM message_definitions \
                      WHERE encoding IN ('ros2msg', 'ros2idl') ORDER BY id DESC";
        let mut statement = connection.prepare(select).map_err(wrong)?;
        let rows = statement.query_map([], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?))
        });
        let pairs: Result<Vec<_>, _> = rows.map_err(wrong)?.collect();
        let named = pairs
            .map_err(wrong)?
            .into_iter()
            .map(|(name, text)| (full_type_name(&name), text));
        Ok(named.filter(|(_, text)| !text.is_empty()).collect())
    }

    fn read_range(&mut self, connection: &Connection) -> Result<(), BagError> {
        let path = self.path.clone();
        let wrong = |e| BagError::sqlite(&path, "table messages", e);
        let select = "SELECT MIN(timestamp), (SELECT MAX(timestamp) FROM messages \
                      WHERE timestamp <= 9223372036854775807) FROM messages WHERE timestamp >= 0";
        let range = connection.query_row(select, [], |row| {
            let (first, last) = (row.get::<_, Option<i64>>(0)?, row.get::<_, Option<i64>>(1)?);
            Ok(first.zip(last))
        });
        self.info.range_ns = range.map_err(wrong)?;
        for topic in &mut self.info.topics {
            topic.message_bytes = Some(0);
        }
        let select = format!(
            "SELECT COALESCE(CAST(topic_id AS INTEGER), -1), COUNT(*), SUM({IMPLAUSIBLE}), \
             TOTAL(octet_length(data)) FROM messages GROUP BY 1"
        );
        let mut statement = connection.prepare(&select).map_err(wrong)?;
        let rows = statement.query_map([], |row| {
            Ok((row.get::<_, i64>(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
        });
        for row in rows.map_err(wrong)? {
            let (id, count, implausible, bytes): (i64, i64, i64, f64) = row.map_err(wrong)?;
            let [count, implausible] = [count, implausible].map(i64::unsigned_abs);
            let is_topic = self.topic_of.contains_key(&id);
            let implausible = if is_topic { implausible } else { count };
            self.info.implausible += implausible;
            self.count(id, count.saturating_sub(implausible));
            let index = self.topic_of.get(&id).copied();
            if let Some(topic) = index.and_then(|index| self.info.topics.get_mut(index)) {
                topic.message_bytes = Some(bytes as u64);
            }
        }
        Ok(())
    }

    fn count(&mut self, topic_id: i64, count: u64) {
        self.info.message_count = self.info.message_count.saturating_add(count);
        let index = self.topic_of.get(&topic_id).copied();
        if let Some(topic) = index.and_then(|index| self.info.topics.get_mut(index)) {
            topic.message_count = topic.message_count.saturating_add(count);
        }
    }

    /// Lists the messages up to the damage, in the order they were written.
    fn rescue(&mut self, connection: &Connection, mut damage: BagError) {
        for topic in &mut self.info.topics {
            topic.message_bytes = None;
            topic.message_count = 0;
        }
        self.info.message_count = 0;
        self.info.implausible = 0;
        let mut keys = stream::readable_keys(connection);
        keys.sort_unstable();
        self.info.range_ns = keys
            .first()
            .zip(keys.last())
            .map(|(a, b)| (a.timestamp_ns, b.timestamp_ns));
        for key in &keys {
            self.count(key.topic_id, 1);
        }
        if let BagError::Truncated {
            readable_messages, ..
        } = &mut damage
        {
            *readable_messages = keys.len() as u64;
        }
        self.info.damage = Some(damage);
        self.rescued = Some(Arc::new(keys));
    }
}

fn names(connection: &Connection, select: &str) -> Result<BTreeSet<String>, rusqlite::Error> {
    let mut statement = connection.prepare(select)?;
    let rows = statement.query_map([], |row| row.get(0))?;
    rows.take(MAX_TOPICS).collect()
}
