//! Messages of all storage files of a bag, merged in order of log time.

use std::{collections::VecDeque, path::PathBuf, sync::Arc};

use super::{
    BagError, BagMessage, TopicInfo,
    sniff::ZSTD_MAGIC,
    split::{OpenFile, Split},
    storage::{StorageMessage, StorageStream},
    zstd_files::decompress_message,
};

/// Compression of single messages.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum MessageCompression {
    /// They are not.
    None,
    /// All are.
    Zstd,
    /// Unknown: those that start like a zstd frame are. CDR starts with a zero byte.
    Detect,
}

/// Messages of a bag in order of log time. Holds one message per storage file that overlaps in
/// time, and for MCAP the chunks that overlap. Ends after the first error.
pub struct Messages {
    splits: Arc<[Split]>,
    topics: Arc<[TopicInfo]>,
    wanted: Vec<bool>,
    start_ns: i64,
    end_ns: Option<i64>,
    compression: MessageCompression,
    /// Not yet opened, in order of time.
    pending: VecDeque<usize>,
    active: Vec<Active>,
    messages_read: u64,
    ended: bool,
}

struct Active {
    path: PathBuf,
    stream: StorageStream,
    topic_of: Vec<usize>,
    head: Result<StorageMessage, BagError>,
    /// Log time of the head, or of the message before an error.
    head_ns: i64,
    order: usize,
}

impl Messages {
    pub(crate) fn new(
        splits: Arc<[Split]>,
        topics: Arc<[TopicInfo]>,
        wanted: Vec<bool>,
        start_ns: i64,
        end_ns: Option<i64>,
        compression: MessageCompression,
    ) -> Messages {
        let in_range = |split: &Split| {
            split.range_ns.is_none_or(|(first, last)| {
                last >= start_ns && end_ns.is_none_or(|end_ns| first < end_ns)
            }) || split.damage().is_some()
        };
        let pending = splits
            .iter()
            .enumerate()
            .filter(|(_, s)| in_range(s))
            .map(|(i, _)| i)
            .collect();
        Messages {
            splits,
            topics,
            wanted,
            start_ns,
            end_ns,
            compression,
            pending,
            active: Vec::new(),
            messages_read: 0,
            ended: false,
        }
    }

    /// Opens the next split if it may hold the next message.
    fn open_due(&mut self) -> Result<(), BagError> {
        while let Some(&index) = self.pending.front() {
            let Some(split) = self.splits.get(index) else {
                return Ok(());
            };
            let first_ns = self.active.iter().map(|a| a.head_ns).min();
            let is_due = match (first_ns, split.range_ns) {
                (None, _) => true,
                (Some(first_ns), Some((start_ns, _))) => start_ns <= first_ns,
                // Splits of unknown time follow each other.
                (Some(_), None) => false,
            };
            if !is_due {
                return Ok(());
            }
            self.pending.pop_front();
            let opened;
            let open = match &split.open {
                Some(open) => open,
                None => {
                    opened = OpenFile::open(&split.path)?;
                    &opened
                }
            };
            let (mut stream, topic_of) = open.wanted(
                &split.path,
                &self.topics,
                &self.wanted,
                self.start_ns,
                self.end_ns,
            )?;
            if let Some(head) = stream.next() {
                let head_ns = head.as_ref().map_or(i64::MAX, |m| m.log_time_ns);
                let path = split.path.clone();
                self.active.push(Active {
                    path,
                    stream,
                    topic_of,
                    head,
                    head_ns,
                    order: index,
                });
            }
        }
        Ok(())
    }

    fn take_first(&mut self) -> Option<Result<BagMessage, BagError>> {
        let first = self
            .active
            .iter()
            .enumerate()
            .min_by_key(|(_, a)| (a.head_ns, a.order));
        let (index, _) = first?;
        let active = self.active.get_mut(index)?;
        let (topic_of, path) = (active.topic_of.clone(), active.path.clone());
        let head = match active.stream.next() {
            Some(next) => {
                // An error keeps its place behind the last message.
                active.head_ns = next.as_ref().map_or(active.head_ns, |m| m.log_time_ns);
                std::mem::replace(&mut active.head, next)
            }
            None => self.active.swap_remove(index).head,
        };
        let number = self.messages_read;
        self.messages_read += 1;
        Some(head.map_err(|e| e.in_file(&path)).and_then(|message| {
            let StorageMessage {
                topic,
                log_time_ns,
                data,
            } = message;
            let wrong = |reason: String| {
                BagError::corrupt(
                    &path,
                    format!("message {number}"),
                    reason,
                    "take another copy of the file",
                )
            };
            let topic = topic_of
                .get(topic)
                .copied()
                .ok_or_else(|| wrong("its topic is not listed".into()))?;
            let data = match self.compression {
                MessageCompression::Zstd => decompress_message(&data).map_err(wrong)?,
                MessageCompression::Detect if data.starts_with(ZSTD_MAGIC) => {
                    decompress_message(&data).map_err(wrong)?
                }
                _ => data,
            };
            Ok(BagMessage {
                topic,
                log_time_ns,
                data,
            })
        }))
    }
}

impl Iterator for Messages {
    type Item = Result<BagMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let next = match self.open_due() {
            Ok(()) => self.take_first(),
            Err(error) => Some(Err(error)),
        };
        self.ended = !matches!(next, Some(Ok(_)));
        next
    }
}
