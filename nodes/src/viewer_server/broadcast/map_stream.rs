//! Map stream shared by all clients: a keyframe, the updates after it, and a cursor per client.
//!
//! A client has a cursor and no queued messages, so slow clients need no memory. A client more than the kept
//! updates behind receives a new keyframe.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// A map message.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Creation time, ns.
    pub stamp_ns: u64,
    /// CDR.
    pub cdr: Arc<[u8]>,
    /// CDR of the thin form, if any.
    pub thin: Option<Arc<[u8]>>,
}

impl Entry {
    /// Bytes of both forms.
    pub fn bytes(&self) -> usize {
        self.cdr.len() + self.thin.as_ref().map_or(0, |thin| thin.len())
    }

    /// The message with its thin form only.
    pub fn thinned(self) -> Self {
        Self {
            cdr: self.thin.unwrap_or(self.cdr),
            thin: None,
            ..self
        }
    }
}

/// Keyframe chunks, and the number of the first update after them.
#[derive(Clone, Debug)]
struct Keyframe {
    chunks: Arc<[Entry]>,
    bytes: usize,
    at: u64,
}

/// Position of a client in the stream.
#[derive(Clone, Debug, Default)]
pub enum Cursor {
    /// Before a keyframe.
    #[default]
    Fresh,
    /// Within a keyframe.
    Keyframe {
        /// Chunks of the keyframe.
        chunks: Arc<[Entry]>,
        /// Index of the next chunk.
        next: usize,
        /// Number of the next update after it.
        at: u64,
    },
    /// Before the update with this number.
    Updates(u64),
}

/// Next message for a client.
#[derive(Debug, PartialEq)]
pub enum Next {
    /// A chunk of a keyframe.
    Map(Entry),
    /// An update.
    Update(Entry),
    /// No message yet.
    Nothing,
    /// No message until there is a keyframe, which is needed.
    Waits,
}

/// The stream.
#[derive(Debug)]
pub struct MapStream {
    limit_bytes: usize,
    keyframe: Option<Keyframe>,
    updates: VecDeque<Entry>,
    bytes: usize,
    /// Number of the next update.
    end: u64,
    /// Number of times that a client fell behind the kept updates.
    fallen_behind: u64,
}

/// Bytes of updates that are always kept, even for small keyframes.
const FEW_BYTES: usize = 256 << 10;

impl MapStream {
    /// Stream that keeps at most `limit_bytes` of updates.
    pub fn new(limit_bytes: usize) -> Self {
        Self {
            limit_bytes,
            keyframe: None,
            updates: VecDeque::new(),
            bytes: 0,
            end: 0,
            fallen_behind: 0,
        }
    }

    /// Adds an update.
    pub fn push(&mut self, update: Entry) {
        self.bytes = self.bytes.saturating_add(update.bytes());
        self.updates.push_back(update);
        self.end += 1;
        while self.bytes > self.limit_bytes {
            let Some(oldest) = self.updates.pop_front() else {
                break;
            };
            self.bytes = self.bytes.saturating_sub(oldest.bytes());
        }
        let begin = self.begin();
        if self
            .keyframe
            .as_ref()
            .is_some_and(|keyframe| keyframe.at < begin)
        {
            self.keyframe = None;
        }
    }

    /// Sets the keyframe of the state after the last update.
    pub fn set_keyframe(&mut self, chunks: Vec<Entry>) {
        self.keyframe = Some(Keyframe {
            bytes: chunks.iter().map(Entry::bytes).sum(),
            chunks: chunks.into(),
            at: self.end,
        });
    }

    /// Restarts with another map: every client needs a keyframe.
    pub fn reset(&mut self) {
        self.keyframe = None;
        self.updates.clear();
        self.bytes = 0;
        // Equivalent to an update missed by all.
        self.end += 1;
    }

    /// Next message of a client; advances its cursor.
    pub fn next(&mut self, cursor: &mut Cursor) -> Next {
        loop {
            match cursor {
                Cursor::Fresh => match self.usable_keyframe() {
                    Some(keyframe) => {
                        let chunks = Arc::clone(&keyframe.chunks);
                        let (next, at) = (0, keyframe.at);
                        *cursor = Cursor::Keyframe { chunks, next, at };
                    }
                    None => return Next::Waits,
                },
                Cursor::Keyframe { chunks, next, at } => match chunks.get(*next) {
                    Some(chunk) => {
                        *next += 1;
                        return Next::Map(chunk.clone());
                    }
                    None => *cursor = Cursor::Updates(*at),
                },
                Cursor::Updates(at) => {
                    let Some(index) = at.checked_sub(self.begin()) else {
                        self.fallen_behind += 1;
                        *cursor = Cursor::Fresh;
                        continue;
                    };
                    let update = usize::try_from(index).ok();
                    let Some(update) = update.and_then(|index| self.updates.get(index)) else {
                        return Next::Nothing;
                    };
                    *at += 1;
                    return Next::Update(update.clone());
                }
            }
        }
    }

    /// Number of times that a client fell behind the kept updates.
    pub fn fallen_behind(&self) -> u64 {
        self.fallen_behind
    }

    /// Bytes kept.
    pub fn kept_bytes(&self) -> usize {
        self.bytes + self.keyframe.as_ref().map_or(0, |keyframe| keyframe.bytes)
    }

    /// Number of the oldest kept update.
    fn begin(&self) -> u64 {
        self.end - self.updates.len() as u64
    }

    /// The keyframe, if it is recent enough.
    fn usable_keyframe(&self) -> Option<&Keyframe> {
        let keyframe = self.keyframe.as_ref()?;
        let index = usize::try_from(keyframe.at.checked_sub(self.begin())?).ok()?;
        let since = self.updates.iter().skip(index);
        let since: usize = since.map(Entry::bytes).sum();
        (since <= keyframe.bytes.max(FEW_BYTES)).then_some(keyframe)
    }
}

/// Stream entry of a message, stamped now.
pub fn entry(cdr: Vec<u8>) -> Entry {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    Entry {
        stamp_ns: since.map_or(0, |since| since.as_nanos() as u64),
        cdr: cdr.into(),
        thin: None,
    }
}
