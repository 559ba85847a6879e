//! Writes SQLite files of schema version 4 (ROS 2 Iron and later).

use std::{
    collections::BTreeSet,
    io,
    path::{Path, PathBuf},
};

use rusqlite::{Connection, params};

use crate::{BagError, TopicInfo, storage::definition_encoding};

/// A transaction is committed when it holds this much, bytes.
const TRANSACTION_BYTES: usize = 32 << 20;

const TABLES: &str = "
    PRAGMA journal_mode = MEMORY;
    PRAGMA synchronous = OFF;
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
    path: PathBuf,
    connection: Connection,
    /// Row by topic.
    topic_ids: Vec<i64>,
    defined: BTreeSet<String>,
    open_bytes: usize,
}

impl SqliteSink {
    pub(super) fn create(path: &Path, ros_distro: &str) -> Result<SqliteSink, BagError> {
        let wrong = |e| failed(path, "create", e);
        let connection = Connection::open(path).map_err(wrong)?;
        connection.execute_batch(TABLES).map_err(wrong)?;
        connection
            .execute("INSERT INTO schema VALUES (4, ?1)", [ros_distro])
            .map_err(wrong)?;
        Ok(SqliteSink {
            path: path.to_path_buf(),
            connection,
            topic_ids: Vec::new(),
            defined: BTreeSet::new(),
            open_bytes: 0,
        })
    }

    pub(super) fn add_topic(&mut self, topic: &TopicInfo, qos: &str) -> Result<(), BagError> {
        let wrong = |e| failed(&self.path, "add a topic to", e);
        if let Some(text) = &topic.definition
            && self.defined.insert(topic.type_name.clone())
        {
            let encoding = definition_encoding(text);
            let insert = "INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition, \
                          type_description_hash) VALUES (?1, ?2, ?3, '')";
            self.connection
                .execute(insert, params![topic.type_name, encoding, text])
                .map_err(wrong)?;
        }
        let insert = "INSERT INTO topics(name, type, serialization_format, offered_qos_profiles, \
                      type_description_hash) VALUES (?1, ?2, ?3, ?4, '')";
        let values = params![topic.name, topic.type_name, topic.serialization_format, qos];
        self.connection.execute(insert, values).map_err(wrong)?;
        self.topic_ids.push(self.connection.last_insert_rowid());
        Ok(())
    }

    pub(super) fn write(
        &mut self,
        topic: usize,
        log_time_ns: i64,
        data: &[u8],
    ) -> Result<(), BagError> {
        let unknown = || BagError::Invalid {
            name: "topic",
            reason: format!("{topic} was not added"),
        };
        let id = self.topic_ids.get(topic).ok_or_else(unknown)?;
        let wrong = |e| failed(&self.path, "write", e);
        let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        let mut statement = self.connection.prepare_cached(insert).map_err(wrong)?;
        statement
            .execute(params![id, log_time_ns, data])
            .map_err(wrong)?;
        self.open_bytes = self.open_bytes.saturating_add(data.len());
        if self.open_bytes >= TRANSACTION_BYTES {
            self.connection
                .execute_batch("COMMIT; BEGIN")
                .map_err(wrong)?;
            self.open_bytes = 0;
        }
        Ok(())
    }

    pub(super) fn finish(self, version: u32, metadata: &str) -> Result<(), BagError> {
        let wrong = |e| failed(&self.path, "finish", e);
        let insert = "INSERT INTO metadata(metadata_version, metadata) VALUES (?1, ?2)";
        self.connection
            .execute(insert, params![version, metadata])
            .map_err(wrong)?;
        self.connection
            .execute_batch("COMMIT; PRAGMA optimize")
            .map_err(wrong)?;
        self.connection
            .close()
            .map_err(|(_, e)| failed(&self.path, "close", e))
    }
}

fn failed(path: &Path, doing: &'static str, error: rusqlite::Error) -> BagError {
    BagError::io(path, doing)(io::Error::other(error))
}
