//! SQLite writer with schema version 4 (ROS 2 Iron and later).

use std::{collections::BTreeSet, path::Path};

use rusqlite::{Connection, params};

use super::{ROS_DISTRO, Sink, SinkError};
use crate::{TopicInfo, metadata::METADATA_VERSION, storage::definition_encoding};

/// Transaction size before a commit, bytes.
const TRANSACTION_BYTES: usize = 32 << 20;

const TABLES: &str = "
    PRAGMA journal_mode = WAL;
    PRAGMA synchronous = NORMAL;
    BEGIN;
    CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
    CREATE TABLE metadata(
        id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
    CREATE TABLE topics(
        id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
        offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);
    CREATE TABLE message_definitions(
        id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
        encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
    CREATE TABLE messages(
        id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
    CREATE INDEX timestamp_idx ON messages(timestamp ASC);
";

pub(super) struct SqliteSink {
    connection: Connection,
    defined: BTreeSet<String>,
    open_bytes: usize,
}

impl SqliteSink {
    pub(super) fn create(path: &Path) -> Result<SqliteSink, SinkError> {
        let connection = Connection::open(path)?;
        connection.execute_batch(TABLES)?;
        connection.execute("INSERT INTO schema VALUES (4, ?1)", [ROS_DISTRO])?;
        Ok(SqliteSink {
            connection,
            defined: BTreeSet::new(),
            open_bytes: 0,
        })
    }
}

impl Sink for SqliteSink {
    fn add_topic(&mut self, topic: &TopicInfo, qos: &str) -> Result<(), SinkError> {
        let hash = &topic.type_hash;
        if let Some(text) = &topic.definition
            && self.defined.insert(topic.type_name.clone())
        {
            let insert = "INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition, \
                          type_description_hash) VALUES (?1, ?2, ?3, ?4)";
            let values = params![topic.type_name, definition_encoding(text), text, hash];
            self.connection.execute(insert, values)?;
        }
        let insert = "INSERT INTO topics(name, type, serialization_format, offered_qos_profiles, \
                      type_description_hash) VALUES (?1, ?2, ?3, ?4, ?5)";
        let values = params![
            topic.name,
            topic.type_name,
            topic.serialization_format,
            qos,
            hash
        ];
        self.connection.execute(insert, values)?;
        Ok(())
    }

    fn write(&mut self, topic: usize, log_time_ns: i64, data: &[u8]) -> Result<(), SinkError> {
        // SQLite numbers the rows of an empty table from 1.
        let id = i64::try_from(topic)? + 1;
        let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        let mut statement = self.connection.prepare_cached(insert)?;
        statement.execute(params![id, log_time_ns, data])?;
        drop(statement);
        self.open_bytes = self.open_bytes.saturating_add(data.len());
        if self.open_bytes >= TRANSACTION_BYTES {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), SinkError> {
        self.open_bytes = 0;
        Ok(self.connection.execute_batch("COMMIT; BEGIN")?)
    }

    fn finish(self: Box<Self>, metadata: &str) -> Result<(), SinkError> {
        let insert = "INSERT INTO metadata(metadata_version, metadata) VALUES (?1, ?2)";
        let values = params![METADATA_VERSION, metadata];
        self.connection.execute(insert, values)?;
        self.connection
            .execute_batch("COMMIT; PRAGMA optimize; PRAGMA journal_mode = DELETE")?;
        Ok(self.connection.close().map_err(|(_, error)| error)?)
    }
}
