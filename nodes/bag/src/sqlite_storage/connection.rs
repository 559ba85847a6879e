//! Read-only SQLite connections that create no files, and a check of the file size.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
    sync::Arc,
};

use rusqlite::{Connection, OpenFlags, config::DbConfig};
use tempfile::{Builder, TempPath};

use crate::{BagError, sniff::SQLITE_MAGIC};

/// Strictness of SQLite with a file.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Access {
    /// Rejects pages with invalid cells.
    Strict,
    /// Reads the existing pages of a truncated database.
    Cut,
    /// Reads the valid cells of each page, also in truncated databases.
    Damaged,
}

/// Opens read-only. `immutable` keeps SQLite from creating files beside the database, so that read-only
/// folders work. It would hide rows in a write-ahead log, so it is not used if one exists.
pub(super) fn connect(path: &Path, access: Access) -> Result<Connection, BagError> {
    let path = &std::path::absolute(path).map_err(BagError::io(path, "locate"))?;
    let has_wal = has_wal(path);
    let parameters = if has_wal {
        "mode=ro"
    } else {
        "mode=ro&immutable=1"
    };
    let uri = format!("file:{}?{parameters}", percent_encode(path));
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_URI
        | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let cut = access != Access::Strict;
    let wrong = |e| {
        let remedy = if has_wal {
            "a recorder did not finish: copy the .db3 and .db3-wal files to a writable folder and open them there"
        } else {
            "take another copy, or rescue the rest with `lattice bag recover`"
        };
        BagError::corrupt(path, "its start", e, remedy)
    };
    let connection = Connection::open_with_flags(uri, flags).map_err(wrong)?;
    for (setting, on) in [
        // SQLite rejects a truncated database unless its schema is writable, which excludes
        // defensive mode; the connection is read-only anyway.
        (DbConfig::SQLITE_DBCONFIG_DEFENSIVE, !cut),
        (DbConfig::SQLITE_DBCONFIG_WRITABLE_SCHEMA, cut),
        (DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false),
    ] {
        connection.set_db_config(setting, on).map_err(wrong)?;
    }
    let check = match access {
        Access::Damaged => "OFF",
        Access::Strict | Access::Cut => "ON",
    };
    connection
        .execute_batch(&format!(
            "PRAGMA cell_size_check = {check}; PRAGMA mmap_size = 0;"
        ))
        .map_err(wrong)?;
    Ok(connection)
}

/// True if a write-ahead log exists: SQLite appends "-wal" to the whole name.
fn has_wal(path: &Path) -> bool {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    Path::new(&name).metadata().is_ok_and(|wal| wal.len() > 0)
}

/// True if the write-ahead log completes the database: a writer stopped during a checkpoint
/// leaves a first page that counts pages of the log.
fn wal_completes(path: &Path) -> bool {
    let opens = |connection: Connection| {
        let count = "SELECT COUNT(*) FROM sqlite_master";
        connection.query_row(count, [], |_| Ok(())).is_ok()
    };
    has_wal(path) && connect(path, Access::Strict).is_ok_and(opens)
}

fn percent_encode(path: &Path) -> String {
    let encoded = |byte: &u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' => char::from(*byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    path.as_os_str()
        .as_encoded_bytes()
        .iter()
        .map(encoded)
        .collect()
}

/// A truncated database.
pub(super) struct Cut {
    pub damage: BagError,
    /// Size of the complete pages; SQLite would read an incomplete one as zeros, bytes.
    pub whole_bytes: u64,
}

impl Cut {
    /// Copies the complete pages.
    pub(super) fn whole_pages(&self, path: &Path) -> Result<Arc<TempPath>, BagError> {
        let copy = || -> io::Result<TempPath> {
            let mut copy = Builder::new().prefix("lattice_bag_").tempfile()?;
            let mut whole = File::open(path)?.take(self.whole_bytes);
            io::copy(&mut whole, copy.as_file_mut())?;
            Ok(copy.into_temp_path())
        };
        copy()
            .map(Arc::new)
            .map_err(BagError::io(path, "copy the whole pages of"))
    }
}

/// Copy with the correct magic, of a file with a wrong one.
pub(super) fn mended_magic(path: &Path) -> Result<Option<Arc<TempPath>>, BagError> {
    let mut file = File::open(path).map_err(BagError::io(path, "open"))?;
    let mut magic = Vec::new();
    let mut start = file.by_ref().take(SQLITE_MAGIC.len() as u64);
    let read = start.read_to_end(&mut magic);
    read.map_err(BagError::io(path, "read"))?;
    if SQLITE_MAGIC.starts_with(&magic) {
        return Ok(None);
    }
    log::warn!("{}: its first bytes are damaged", path.display());
    let mut copy = || -> io::Result<TempPath> {
        let mut copy = Builder::new().prefix("lattice_bag_").tempfile()?;
        io::copy(&mut SQLITE_MAGIC.chain(&mut file), copy.as_file_mut())?;
        Ok(copy.into_temp_path())
    };
    let copied = copy().map(Arc::new);
    copied.map(Some).map_err(BagError::io(path, "copy"))
}

/// Compares the size in the database header with the file's (https://www.sqlite.org/fileformat.html, 1.3).
pub(super) fn missing_pages(path: &Path) -> Result<Option<Cut>, BagError> {
    if wal_completes(path) {
        return Ok(None);
    }
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
    let page_bytes = match word(16) >> 16 {
        1 => 65_536,
        bytes => u64::from(bytes),
    };
    // The count is valid only if its version equals the change counter.
    let pages = if word(24) == word(92) {
        u64::from(word(28))
    } else {
        0
    };
    let cut = pages * page_bytes > size_bytes;
    let inside = format!("the database, whose header counts {pages} pages of {page_bytes} bytes");
    Ok(cut.then(|| Cut {
        damage: truncated(inside),
        whole_bytes: size_bytes - size_bytes % page_bytes,
    }))
}
