//! Messages of all storage files of a bag, merged in order of log time.

use std::{collections::VecDeque, path::PathBuf, sync::Arc};

use super::{
    BagError, BagMessage, TopicInfo,
    sniff::ZSTD_MAGIC,
    split::{OpenFile, Split},
    storage::{Filter, StorageMessage, StorageStream},
    zstd_files::decompress_message,
};

/// Compression of individual messages.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum MessageCompression {
    /// No message is compressed.
    None,
    /// All messages are compressed.
    Zstd,
    /// Unknown: messages that start like a zstd frame are decompressed. CDR starts with a zero byte.
    Detect,
}

/// Messages of a bag in order of log time. Buffers one message per storage file that overlaps in
/// time, and for MCAP the overlapping chunks. Ends after the first error.
pub struct Messages {
    splits: Arc<[Split]>,
    topics: Arc<[TopicInfo]>,
    /// Filter by topics of the bag.
    filter: Filter,
    compression: MessageCompression,
    /// Unopened files, in order of time.
    pending: VecDeque<usize>,
    active: Vec<Active>,
    /// True to end a truncated file without an error.
    past_cut: bool,
    messages_read: u64,
    unchecked: bool,
    ended: bool,
}

struct Active {
    path: PathBuf,
    stream: StorageStream,
    topic_of: Vec<usize>,
    head: Option<Result<StorageMessage, BagError>>,
    /// Log time of the head, or of the message before an error.
    head_ns: i64,
    order: usize,
}

impl Messages {
    pub(crate) fn new(
        splits: Arc<[Split]>,
        topics: Arc<[TopicInfo]>,
        filter: Filter,
        compression: MessageCompression,
        past_cut: bool,
    ) -> Messages {
        let in_range = |split: &Split| {
            split
                .range_ns
                .is_none_or(|range_ns| filter.overlaps(range_ns))
                || split.damage().is_some()
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
            filter,
            compression,
            pending,
            active: Vec::new(),
            past_cut,
            messages_read: 0,
            unchecked: false,
            ended: false,
        }
    }

    /// True if the last message is of a damaged chunk, whose checksum is wrong.
    pub(crate) fn is_unchecked(&self) -> bool {
        self.unchecked
    }

    /// Opens the next file if it may contain the next message.
    fn open_due(&mut self) -> Result<(), BagError> {
        while let Some(&index) = self.pending.front() {
            let Some(split) = self.splits.get(index) else {
                return Ok(());
            };
            let first_ns = self.active.iter().map(|a| a.head_ns).min();
            let is_due = match (first_ns, split.range_ns) {
                (None, _) => true,
                (Some(first_ns), Some((start_ns, _))) => start_ns <= first_ns,
                // Files of unknown time follow each other.
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
            let (mut stream, topic_of) = open.wanted(&split.path, &self.topics, &self.filter)?;
            let head = stream.next();
            let head_ns = match &head {
                Some(Ok(message)) => message.log_time_ns,
                // A file that begins with damage keeps its place; one of unknown time is reached now.
                Some(Err(_)) => split.range_ns.map_or(i64::MIN, |(start_ns, _)| start_ns),
                None => continue,
            };
            self.active.push(Active {
                path: split.path.clone(),
                stream,
                topic_of,
                head,
                head_ns,
                order: index,
            });
        }
        Ok(())
    }

    /// True for the error at the end of a truncated file, where it is ignored; the reader has warned about it.
    fn is_passed_cut(&self, error: &BagError) -> bool {
        self.past_cut && !self.filter.past_damage && matches!(error, BagError::Truncated { .. })
    }

    fn take_first(&mut self) -> Option<Result<BagMessage, BagError>> {
        let files = self.active.iter().enumerate();
        let (index, _) = files.min_by_key(|(_, a)| (a.head_ns, a.order))?;
        let active = self.active.get_mut(index)?;
        // Nothing is read after an error.
        let next = match &active.head {
            Some(Err(_)) if !self.filter.past_damage => None,
            _ => active.stream.next(),
        };
        // An error keeps its place after the last message.
        if let Some(Ok(message)) = &next {
            active.head_ns = message.log_time_ns;
        }
        let head = std::mem::replace(&mut active.head, next)?;
        self.unchecked = head.as_ref().is_ok_and(|message| message.unchecked);
        let message = active.of_bag(head, self.compression, self.messages_read);
        self.messages_read += 1;
        if active.head.is_none() {
            self.active.swap_remove(index);
        }
        Some(message)
    }
}

impl Active {
    /// The file's message as one of the bag, decompressed.
    fn of_bag(
        &self,
        message: Result<StorageMessage, BagError>,
        compression: MessageCompression,
        number: u64,
    ) -> Result<BagMessage, BagError> {
        let message = message.map_err(|e| e.in_file(&self.path))?;
        let wrong = |reason: String| {
            let remedy = "take another copy of the file";
            BagError::corrupt(&self.path, format!("message {number}"), reason, remedy)
        };
        let topic = self.topic_of.get(message.topic).copied();
        let topic = topic.ok_or_else(|| wrong("its topic is not listed".into()))?;
        let mut data = message.data;
        let is_packed = match compression {
            MessageCompression::None => false,
            MessageCompression::Zstd => true,
            MessageCompression::Detect => data.starts_with(ZSTD_MAGIC),
        };
        if is_packed {
            data = decompress_message(&data).map_err(wrong)?;
        }
        Ok(BagMessage {
            topic,
            log_time_ns: message.log_time_ns,
            data,
        })
    }
}

impl Iterator for Messages {
    type Item = Result<BagMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let next = loop {
            let next = match self.open_due() {
                Ok(()) => self.take_first(),
                Err(error) => Some(Err(error)),
            };
            match next {
                Some(Err(error)) if self.is_passed_cut(&error) => {}
                next => break next,
            }
        };
        self.ended = match &next {
            None => true,
            Some(Err(_)) => !self.filter.past_damage,
            Some(Ok(_)) => false,
        };
        next
    }
}
