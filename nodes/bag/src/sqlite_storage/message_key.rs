//! Key of a message.

/// Key of a message, ordered by time, then by row.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct Key {
    pub timestamp_ns: i64,
    pub id: i64,
    pub topic_id: i64,
    pub(super) size_bytes: u64,
}

/// Columns of a key; a topic id that is not a number becomes -1.
pub(super) const KEY_COLUMNS: &str =
    "SELECT timestamp, id, COALESCE(CAST(topic_id AS INTEGER), -1), octet_length(data)";

pub(super) fn key(row: &rusqlite::Row<'_>) -> Result<Key, rusqlite::Error> {
    Ok(Key {
        timestamp_ns: row.get(0)?,
        id: row.get(1)?,
        topic_id: row.get(2)?,
        size_bytes: row
            .get::<_, Option<i64>>(3)?
            .and_then(|n| u64::try_from(n).ok())
            .unwrap_or(0),
    })
}
