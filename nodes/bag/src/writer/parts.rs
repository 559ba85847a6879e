//! Consecutive storage files of a bag being written.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::{Compression, Sink, SinkError, failed, mcap_sink::McapSink, sqlite_sink::SqliteSink};
use crate::metadata::{EMPTY_START_NS, FileInformation, Nanoseconds, StartingTime};
use crate::{BagError, Storage};

/// zstd level for files and messages.
pub(super) const ZSTD_LEVEL: i32 = 1;

/// Number of messages, with first and last log time.
#[derive(Clone, Copy, Default)]
pub(super) struct Written {
    pub messages: u64,
    pub bytes: u64,
    range_ns: Option<(i64, i64)>,
}

impl Written {
    pub(super) fn add(&mut self, log_time_ns: i64, bytes: usize) {
        self.messages += 1;
        self.bytes = self.bytes.saturating_add(bytes as u64);
        let (first_ns, last_ns) = self.range_ns.unwrap_or((log_time_ns, log_time_ns));
        self.range_ns = Some((first_ns.min(log_time_ns), last_ns.max(log_time_ns)));
    }

    /// Time span of the messages with one more at `log_time_ns`, ns.
    pub(super) fn span_with(&self, log_time_ns: i64) -> i64 {
        self.range_ns.map_or(0, |(first_ns, last_ns)| {
            last_ns.max(log_time_ns).saturating_sub(first_ns)
        })
    }

    pub(super) fn times(&self) -> (StartingTime, Nanoseconds) {
        let (first_ns, last_ns) = self.range_ns.unwrap_or((EMPTY_START_NS, EMPTY_START_NS));
        let nanoseconds = last_ns.saturating_sub(first_ns);
        let starting_time = StartingTime {
            nanoseconds_since_epoch: first_ns,
        };
        (starting_time, Nanoseconds { nanoseconds })
    }
}

/// A storage file being written.
pub(super) struct Part {
    pub file: PathBuf,
    pub sink: Box<dyn Sink>,
    pub written: Written,
}

impl Part {
    /// Creates the file of a number, which must not exist.
    pub(super) fn create(folder: &Path, storage: Storage, number: usize) -> Result<Part, BagError> {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let file = folder.join(format!("{name}_{number}.{}", storage.extension()));
        let created = File::create_new(&file).map_err(BagError::io(&file, "create"))?;
        let sink: Result<Box<dyn Sink>, SinkError> = match storage {
            Storage::Mcap => McapSink::create(created).map(|sink| Box::new(sink) as _),
            Storage::Sqlite3 => {
                // Closing it later would release the locks that SQLite takes on the file.
                drop(created);
                SqliteSink::create(&file).map(|sink| Box::new(sink) as _)
            }
        };
        Ok(Part {
            sink: sink.map_err(failed(&file, "create"))?,
            file,
            written: Written::default(),
        })
    }

    /// Syncs the file to disk, optionally compressed; returns its metadata entry.
    pub(super) fn finish(
        self,
        metadata: &str,
        compression: Compression,
    ) -> Result<FileInformation, BagError> {
        let mut file = self.file;
        let finished = self.sink.finish(metadata);
        finished.map_err(failed(&file, "finish"))?;
        if compression == Compression::Files {
            file = compress(&file).map_err(BagError::io(&file, "compress"))?;
        }
        let synced = File::open(&file).and_then(|file| file.sync_all());
        synced.map_err(BagError::io(&file, "finish"))?;
        Ok(described(&file, &self.written))
    }
}

/// Metadata entry of a storage file.
pub(super) fn described(file: &Path, written: &Written) -> FileInformation {
    let (starting_time, duration) = written.times();
    let name = file.file_name().unwrap_or_default();
    FileInformation {
        path: name.to_string_lossy().into_owned(),
        starting_time,
        duration,
        message_count: written.messages,
    }
}

/// Replaces a file by its compressed form with the extension `.zstd`.
fn compress(file: &Path) -> io::Result<PathBuf> {
    let mut packed = file.as_os_str().to_owned();
    packed.push(".zstd");
    let packed = PathBuf::from(packed);
    // Renamed only once complete and on disk, so that one of the two always exists.
    let mut part = file.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let mut out = File::create_new(&part)?;
    let mut encoder = zstd::stream::Encoder::new(&mut out, ZSTD_LEVEL)?;
    // Lets a reader detect a changed byte.
    encoder.include_checksum(true)?;
    std::io::copy(&mut File::open(file)?, &mut encoder)?;
    encoder.finish()?;
    out.sync_all()?;
    fs::rename(&part, &packed)?;
    fs::remove_file(file)?;
    Ok(packed)
}
