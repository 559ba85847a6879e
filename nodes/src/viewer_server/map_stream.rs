//! The map as one stream for all clients: a keyframe, what followed it, and where each client is.
//!
//! A client holds a place in the stream and no messages, so a slow one costs nothing but its place; one
//! that falls out of what is kept begins again with a keyframe.

use std::collections::VecDeque;
use std::sync::Arc;

/// A message of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Time at which it was made, in ns.
    pub stamp_ns: u64,
    /// CDR.
    pub cdr: Arc<[u8]>,
    /// CDR of the thin form, where there is one.
    pub thin: Option<Arc<[u8]>>,
}

impl Entry {
    /// Bytes of both forms.
    pub fn bytes(&self) -> usize {
        self.cdr.len() + self.thin.as_ref().map_or(0, |thin| thin.len())
    }

    /// The message in its thin form alone.
    pub fn thinned(self) -> Self {
        Self {
            cdr: self.thin.unwrap_or(self.cdr),
            thin: None,
            ..self
        }
    }
}

/// Chunks of a keyframe, and the number of the first update that follows it.
#[derive(Clone, Debug)]
struct Keyframe {
    chunks: Arc<[Entry]>,
    bytes: usize,
    at: u64,
}

/// Place of a client in the stream.
#[derive(Clone, Debug, Default)]
pub enum Cursor {
    /// Before a keyframe.
    #[default]
    Fresh,
    /// Within one.
    Keyframe {
        /// All of it.
        chunks: Arc<[Entry]>,
        /// The next chunk.
        next: usize,
        /// The update after the last.
        at: u64,
    },
    /// Before this update.
    Updates(u64),
}

/// The next message for a client.
#[derive(Debug, PartialEq)]
pub enum Next {
    /// A chunk of a keyframe.
    Map(Entry),
    /// An update.
    Update(Entry),
    /// None yet.
    Nothing,
    /// None until there is a keyframe, which is now wanted.
    Waits,
}

/// The stream.
#[derive(Debug)]
pub struct MapStream {
    limit_bytes: usize,
    keyframe: Option<Keyframe>,
    updates: VecDeque<Entry>,
    bytes: usize,
    /// Number of the update that comes next.
    end: u64,
    /// Times that a client fell out of what is kept.
    fallen_behind: u64,
}

/// Updates that a keyframe may be followed by whatever its size.
const FEW_BYTES: usize = 256 << 10;

impl MapStream {
    /// A stream that keeps updates of at most `limit_bytes`.
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

    /// The keyframe of the state after the last update.
    pub fn set_keyframe(&mut self, chunks: Vec<Entry>) {
        self.keyframe = Some(Keyframe {
            bytes: chunks.iter().map(Entry::bytes).sum(),
            chunks: chunks.into(),
            at: self.end,
        });
    }

    /// Begins with another map: every client needs a keyframe.
    pub fn reset(&mut self) {
        self.keyframe = None;
        self.updates.clear();
        self.bytes = 0;
        // As if one update were lost to all.
        self.end += 1;
    }

    /// The next message of a client, whose place moves on.
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

    /// Times that a client fell out of what is kept.
    pub fn fallen_behind(&self) -> u64 {
        self.fallen_behind
    }

    /// Bytes of what is kept.
    pub fn kept_bytes(&self) -> usize {
        self.bytes + self.keyframe.as_ref().map_or(0, |keyframe| keyframe.bytes)
    }

    /// Number of the oldest update that is kept.
    fn begin(&self) -> u64 {
        self.end - self.updates.len() as u64
    }

    /// The keyframe, if it is not far behind.
    fn usable_keyframe(&self) -> Option<&Keyframe> {
        let keyframe = self.keyframe.as_ref()?;
        let index = usize::try_from(keyframe.at.checked_sub(self.begin())?).ok()?;
        let since = self.updates.iter().skip(index);
        let since: usize = since.map(Entry::bytes).sum();
        (since <= keyframe.bytes.max(FEW_BYTES)).then_some(keyframe)
    }
}
