//! SQLite storage files of every rosbag2 schema, opened so that nothing beside them is written.

mod stream;

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
    fs::File,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use rusqlite::{Connection, OpenFlags, config::DbConfig};
use tempfile::TempPath;

use super::{
    BagError, TopicInfo,
    storage::{Filter, StorageInfo, StorageStream, full_type_name, lenient_qos},
};
use stream::{Key, SqliteStream};

/// More topics than this are refused.
const MAX_TOPICS: usize = 65_536;

/// A SQLite file whose contents are known.
pub(crate) struct SqliteFile {
    path: PathBuf,
    temporary: Option<Arc<TempPath>>,
    topic_of: Arc<BTreeMap<i64, usize>>,
    /// The readable messages in order of time, where damage keeps the database from ordering them.
    rescued: Option<Arc<Vec<Key>>>,
    has_time_index: bool,
    pub(crate) info: StorageInfo,
}

impl SqliteFile {
    /// Opens `path`, which may be a temporary copy that is deleted with the last reader.
    pub(crate) fn open(
        path: &Path,
        temporary: Option<Arc<TempPath>>,
    ) -> Result<SqliteFile, BagError> {
        let missing_pages = missing_pages(path)?;
        let connection = connect(path)?;
        let mut file = SqliteFile {
            path: path.to_path_buf(),
            temporary,
            topic_of: Arc::default(),
            rescued: None,
            has_time_index: false,
            info: StorageInfo::default(),
        };
        let cut = |error: BagError| missing_pages.clone().unwrap_or(error);
        file.read_topics(&connection).map_err(cut)?;
        match (missing_pages.clone(), file.read_range(&connection)) {
            (None, Ok(())) => {}
            (None, Err(error)) => file.rescue(&connection, error)?,
            (Some(damage), _) => file.rescue(&connection, damage)?,
        }
        Ok(file)
    }

    /// The wanted messages in order of log time.
    pub(crate) fn stream(&self, filter: Filter) -> Result<StorageStream, BagError> {
        Ok(Box::new(SqliteStream::new(
            connect(&self.path)?,
            self.path.clone(),
            self.temporary.clone(),
            self.topic_of.clone(),
            filter,
            self.rescued.clone(),
            self.has_time_index,
            self.info.damage.clone(),
        )))
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
        let definitions = self.definitions(connection, &tables)?;
        let wrong = |e| BagError::sqlite(&self.path, "table topics", e);
        let columns =
            names(connection, "SELECT name FROM pragma_table_info('topics')").map_err(wrong)?;
        let qos = match columns.contains("offered_qos_profiles") {
            true => "offered_qos_profiles",
            false => "''",
        };
        let select = format!(
            "SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id LIMIT {MAX_TOPICS}"
        );
        let mut statement = connection.prepare(&select).map_err(wrong)?;
        let rows = statement.query_map([], |row| {
            let text = |i: usize| {
                row.get::<_, Option<String>>(i)
                    .map(Option::unwrap_or_default)
            };
            Ok((
                row.get::<_, i64>(0)?,
                text(1)?,
                text(2)?,
                text(3)?,
                text(4)?,
            ))
        });
        let mut topic_of = BTreeMap::new();
        for row in rows.map_err(wrong)? {
            let (id, name, type_name, serialization_format, qos) = row.map_err(wrong)?;
            let type_name = full_type_name(&type_name);
            topic_of.insert(id, self.info.topics.len());
            self.info.topics.push(TopicInfo {
                offered_qos: lenient_qos(&name, &qos),
                definition: definitions.get(&type_name).cloned(),
                name,
                type_name,
                serialization_format,
                message_count: 0,
            });
        }
        self.topic_of = Arc::new(topic_of);
        let indexed = "SELECT l.name FROM pragma_index_list('messages') AS l, pragma_index_info(l.name) AS i \
                       WHERE i.seqno = 0 AND i.name = 'timestamp'";
        self.has_time_index = names(connection, indexed).is_ok_and(|found| !found.is_empty());
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
        let range = connection
            .query_row(
                "SELECT MIN(timestamp), (SELECT MAX(timestamp) FROM messages) FROM messages",
                [],
                |row| Ok((row.get::<_, Option<i64>>(0)?, row.get::<_, Option<i64>>(1)?)),
            )
            .map_err(wrong)?;
        self.info.range_ns = match range {
            (Some(first), Some(last)) => Some((first, last)),
            _ => None,
        };
        let mut statement = connection
            .prepare("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id")
            .map_err(wrong)?;
        let rows =
            statement.query_map([], |row| Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?)));
        for row in rows.map_err(wrong)? {
            let (id, count) = row.map_err(wrong)?;
            self.count(id, u64::try_from(count).unwrap_or(0));
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
    fn rescue(&mut self, connection: &Connection, damage: BagError) -> Result<(), BagError> {
        for topic in &mut self.info.topics {
            topic.message_count = 0;
        }
        self.info.message_count = 0;
        let mut keys = stream::readable_keys(connection);
        keys.sort_unstable();
        self.info.range_ns = keys
            .first()
            .zip(keys.last())
            .map(|(a, b)| (a.timestamp_ns, b.timestamp_ns));
        for key in &keys {
            self.count(key.topic_id, 1);
        }
        self.info.damage = Some(match damage {
            BagError::Truncated {
                path,
                size_bytes,
                inside,
                ..
            } => BagError::Truncated {
                path,
                size_bytes,
                inside,
                readable_messages: keys.len() as u64,
            },
            other => other,
        });
        self.rescued = Some(Arc::new(keys));
        Ok(())
    }
}

/// Opens read-only. `immutable` keeps SQLite from creating files beside the database, so that a
/// read-only folder works; it would hide rows still in a write-ahead log, so not where one exists.
fn connect(path: &Path) -> Result<Connection, BagError> {
    let path = &std::path::absolute(path).map_err(BagError::io(path, "locate"))?;
    let has_wal = wal_path(path).metadata().is_ok_and(|wal| wal.len() > 0);
    let parameters = if has_wal {
        "mode=ro"
    } else {
        "mode=ro&immutable=1"
    };
    let uri = format!("file:{}?{parameters}", percent_encode(path));
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_URI
        | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let wrong = |e| {
        let remedy = if has_wal {
            "a recorder did not finish: copy the .db3 and .db3-wal files to a writable folder and open them there"
        } else {
            "recover the rows with `sqlite3 FILE .recover` or take another copy"
        };
        BagError::corrupt(path, "its start", e, remedy)
    };
    let connection = Connection::open_with_flags(uri, flags).map_err(wrong)?;
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)
        .map_err(wrong)?;
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)
        .map_err(wrong)?;
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false)
        .map_err(wrong)?;
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)
        .map_err(wrong)?;
    connection
        .execute_batch("PRAGMA cell_size_check = ON; PRAGMA mmap_size = 0;")
        .map_err(wrong)?;
    Ok(connection)
}

/// SQLite appends "-wal" to the whole name.
fn wal_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    PathBuf::from(name)
}

fn percent_encode(path: &Path) -> String {
    let mut encoded = String::new();
    for byte in path.as_os_str().as_encoded_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => {
                encoded.push(char::from(*byte));
            }
            // Writing to a string cannot fail.
            _ => drop(write!(encoded, "%{byte:02X}")),
        }
    }
    encoded
}

/// Compares the size in the database header with the file's (https://www.sqlite.org/fileformat.html, 1.3).
fn missing_pages(path: &Path) -> Result<Option<BagError>, BagError> {
    let mut file = File::open(path).map_err(BagError::io(path, "open"))?;
    let size_bytes = file
        .metadata()
        .map_err(BagError::io(path, "examine"))?
        .len();
    let truncated = |inside: String| BagError::Truncated {
        path: path.to_path_buf(),
        size_bytes,
        inside,
        readable_messages: 0,
    };
    let mut header = [0; 100];
    if size_bytes < header.len() as u64 {
        return Err(truncated("the 100-byte database header at byte 0".into()));
    }
    file.read_exact(&mut header)
        .map_err(BagError::io(path, "read"))?;
    let word = |at: usize| {
        header
            .get(at..at + 4)
            .and_then(|b| b.try_into().ok())
            .map_or(0, u32::from_be_bytes)
    };
    let page_bytes = match header {
        [_, _, _, _, _, _, _, _, _, _, _, _, _, _, _, _, 0, 1, ..] => 65_536,
        [_, _, _, _, _, _, _, _, _, _, _, _, _, _, _, _, a, b, ..] => {
            u64::from(u16::from_be_bytes([a, b]))
        }
    };
    // The count holds only where the version it is valid for equals the change counter.
    let pages = if word(24) == word(92) {
        u64::from(word(28))
    } else {
        0
    };
    let cut = pages * page_bytes > size_bytes;
    Ok(cut.then(|| {
        truncated(format!(
            "the database, whose header counts {pages} pages of {page_bytes} bytes"
        ))
    }))
}

fn names(connection: &Connection, select: &str) -> Result<BTreeSet<String>, rusqlite::Error> {
    let mut statement = connection.prepare(select)?;
    let rows = statement.query_map([], |row| row.get(0))?;
    rows.take(MAX_TOPICS).collect()
}
