//! Recovery of rows from a damaged SQLite file: scans from both ends to the damage, and individual queries within it.

use std::path::Path;

use rusqlite::Connection;

use super::message_key::{KEY_COLUMNS, Key, key};
use crate::BagError;

/// Smallest message row: cell pointer (2), payload and row lengths (2), record header (5),
/// topic (1), time (8) and CDR header (4), bytes. It bounds the number of rows by the file size.
const MIN_ROW_BYTES: u64 = 22;
/// Limit of keys.
const MAX_KEYS: usize = 1 << 26;
/// Limit of listed gaps; further ones are merged into the last.
const MAX_STRETCHES: usize = 1000;

/// Readable rows of the message table.
#[derive(Default)]
pub(super) struct Salvaged {
    /// Keys in order of time.
    pub keys: Vec<Key>,
    /// Unreadable rows: first, last and number.
    pub lost: Vec<(i64, i64, u64)>,
    /// True if the last row id of the table is known.
    pub ends: bool,
}

impl Salvaged {
    /// Number of messages in the file, if its last row is known.
    pub(super) fn claimed(&self) -> Option<u64> {
        let lost = self.lost.iter().map(|(_, _, count)| count).sum::<u64>();
        self.ends
            .then(|| (self.keys.len() as u64).saturating_add(lost))
    }

    pub(super) fn damages(&self, path: &Path) -> impl Iterator<Item = BagError> {
        self.lost.iter().map(move |(first, last, count)| {
            let place = match first == last {
                true => format!("row {first}"),
                false => format!("rows {first} to {last}"),
            };
            let reason = format!("{count} messages cannot be read");
            BagError::corrupt(path, place, reason, "take another copy")
        })
    }

    fn lose(&mut self, id: i64) {
        let is_full = self.lost.len() >= MAX_STRETCHES;
        match self.lost.last_mut() {
            Some((_, last, count)) if is_full || id == *last + 1 => {
                *last = id;
                *count += 1;
            }
            _ => self.lost.push((id, id, 1)),
        }
    }
}

/// Recovers the rows of a file of `file_bytes` with this index of times.
pub(super) fn salvage(
    connection: &Connection,
    time_index: Option<&str>,
    file_bytes: u64,
) -> Salvaged {
    let select =
        |order: &str| format!("{KEY_COLUMNS} FROM messages NOT INDEXED ORDER BY id {order}");
    let (keys, whole) = scan(connection, &select("ASC"), key);
    let (mut keys, ascend) = ascending(keys);
    let whole = whole && ascend;
    let mut ends = whole;
    if !whole {
        let first = keys.last().map_or(i64::MIN, |last| last.id);
        let (mut behind, _) = scan(connection, &select("DESC"), key);
        ends = !behind.is_empty();
        behind.reverse();
        let (behind, _) = ascending(behind);
        keys.extend(behind.into_iter().filter(|key| key.id > first));
    }
    keys.sort_unstable_by_key(|key| key.id);
    keys.dedup_by_key(|key| key.id);
    // The index has separate pages.
    let mut listed = Vec::new();
    if let Some(index) = time_index {
        let index = index.replace('"', "\"\"");
        let select = |order: &str| {
            format!("SELECT id FROM messages INDEXED BY \"{index}\" ORDER BY timestamp {order}")
        };
        let id = |row: &rusqlite::Row<'_>| row.get::<_, i64>(0);
        let (ids, whole) = scan(connection, &select("ASC"), id);
        listed = ids;
        if !whole {
            listed.extend(scan(connection, &select("DESC"), id).0);
        }
        ends |= whole;
        listed.sort_unstable();
        listed.dedup();
    }
    let mut salvaged = Salvaged {
        ends,
        ..Salvaged::default()
    };
    let found = fill(
        connection,
        &keys,
        &listed,
        (whole, file_bytes),
        &mut salvaged,
    );
    keys.extend(found);
    keys.sort_unstable();
    salvaged.keys = keys;
    salvaged
}

/// Keys in ascending order of row id, and whether all were: others cannot be found by their row id.
fn ascending(keys: Vec<Key>) -> (Vec<Key>, bool) {
    let count = keys.len();
    let mut ordered: Vec<Key> = Vec::with_capacity(count);
    for key in keys {
        // Of two contradicting keys, the one consistent with the previous keys stays.
        if ordered.last().is_some_and(|last| last.id >= key.id) {
            let before = ordered.iter().rev().nth(1).map_or(i64::MIN, |key| key.id);
            if key.id <= before {
                continue;
            }
            ordered.pop();
        }
        ordered.push(key);
    }
    let all = ordered.len() == count;
    (ordered, all)
}

/// Queries rows missed by the scans: those listed in the index, and those between the first and the
/// last where a scan met damage.
fn fill(
    connection: &Connection,
    keys: &[Key],
    listed: &[i64],
    (whole, file_bytes): (bool, u64),
    salvaged: &mut Salvaged,
) -> Vec<Key> {
    let most = i64::try_from(file_bytes / MIN_ROW_BYTES).unwrap_or(i64::MAX);
    let is_known = |id: i64| keys.binary_search_by_key(&id, |key| key.id).is_ok();
    let is_listed = |id: i64| listed.binary_search(&id).is_ok();
    let mut found = Vec::new();
    let mut ask = |id: i64, lost: &mut Salvaged| {
        let select = format!("{KEY_COLUMNS} FROM messages NOT INDEXED WHERE id = ?1");
        let asked = connection.prepare_cached(&select);
        match asked.and_then(|mut asked| asked.query_row([id], key)) {
            Ok(key) if key.id == id => found.push(key),
            Err(rusqlite::Error::QueryReturnedNoRows) | Ok(_) if !is_listed(id) => {}
            _ if lost.ends || is_listed(id) => lost.lose(id),
            _ => {}
        }
    };
    if whole {
        let missing = listed.iter().copied().filter(|id| !is_known(*id));
        missing.for_each(|id| ask(id, salvaged));
        return found;
    }
    // Rows count from one; a continued file may begin with a higher number.
    let known = keys.iter().map(|key| key.id).chain(listed.iter().copied());
    let lowest = known.clone().min().unwrap_or(1);
    let first = if (1..=most).contains(&lowest) {
        1
    } else {
        lowest
    };
    let end = first.saturating_add(most);
    let last = match salvaged.ends {
        true => known.filter(|id| *id < end).max().unwrap_or(first),
        false => end,
    };
    for id in first..=last {
        if !is_known(id) {
            ask(id, salvaged);
        }
    }
    found
}

/// Rows up to the first error, and whether there was none.
fn scan<T>(
    connection: &Connection,
    select: &str,
    row: impl FnMut(&rusqlite::Row<'_>) -> Result<T, rusqlite::Error>,
) -> (Vec<T>, bool) {
    let mut found = Vec::new();
    let mut statement = match connection.prepare(select) {
        Ok(statement) => statement,
        Err(_) => return (found, false),
    };
    let Ok(rows) = statement.query_map([], row) else {
        return (found, false);
    };
    for row in rows.take(MAX_KEYS) {
        match row {
            Ok(row) => found.push(row),
            Err(_) => return (found, false),
        }
    }
    (found, true)
}
