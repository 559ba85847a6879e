//! Queue of one client: control messages in order, the map by a cursor, and the newest
//! messages of each other channel.

use std::collections::{BTreeMap, VecDeque};

use super::map_stream::{Cursor, Entry, MapStream, Next};

/// Limit of queued control messages; a client above it is closed.
const MAX_CONTROL: usize = 256;
/// Limit of queued control bytes. One message always fits, of any length.
const MAX_CONTROL_BYTES: usize = 8 << 20;
/// Limit of queued bytes per channel besides the map.
const MAX_RING_BYTES: usize = 8 << 20;

/// Queueing class of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Keyframes of the map.
    Map,
    /// Map updates.
    Updates,
    /// Keyframes in thin form.
    ThinMap,
    /// Updates in thin form.
    ThinUpdates,
    /// The newest messages; older ones are dropped.
    Newest {
        /// Queue length.
        depth: usize,
    },
}

/// A message to a client.
#[derive(Debug, PartialEq)]
pub enum Outgoing {
    /// A control message.
    Text(String),
    /// A binary control message.
    Binary(Vec<u8>),
    /// A message of a subscription.
    Data(u32, Entry),
    /// Close the connection: too many control messages are queued.
    Close,
}

impl Outgoing {
    fn bytes(&self) -> usize {
        match self {
            Self::Text(text) => text.len(),
            Self::Binary(bytes) => bytes.len(),
            Self::Data(_, entry) => entry.bytes(),
            Self::Close => 0,
        }
    }
}

/// Queue of one client.
#[derive(Debug, Default)]
pub struct Outbox {
    control: VecDeque<Outgoing>,
    control_bytes: usize,
    overflown: bool,
    /// Channel and class by subscription id.
    subscriptions: BTreeMap<u32, (u32, Class)>,
    cursor: Cursor,
    rings: BTreeMap<u32, VecDeque<Entry>>,
    /// Subscription id of the last turn.
    turn: u32,
    maps_turn: bool,
    waits_for_keyframe: bool,
    dropped: u64,
}

impl Outbox {
    /// Queues a text control message.
    pub fn control(&mut self, text: String) {
        self.answer(Outgoing::Text(text));
    }

    /// Queues a control message of either kind.
    pub fn answer(&mut self, message: Outgoing) {
        let bytes = self.control_bytes.saturating_add(message.bytes());
        self.overflown |= self.control.len() >= MAX_CONTROL
            || bytes > MAX_CONTROL_BYTES && !self.control.is_empty();
        if !self.overflown {
            self.control_bytes = bytes;
            self.control.push_back(message);
        }
    }

    /// Adds a subscription; false if the id or the channel is subscribed already.
    pub fn subscribe(&mut self, id: u32, channel: u32, class: Class) -> bool {
        let taken = self.subscriptions.contains_key(&id) || self.id_of(channel).is_some();
        if taken {
            return false;
        }
        self.subscriptions.insert(id, (channel, class));
        // Updates sent before the subscription are missing.
        let passed = matches!(self.cursor, Cursor::Updates(_));
        match class {
            Class::Map | Class::ThinMap => self.cursor = Cursor::Fresh,
            Class::Updates | Class::ThinUpdates if passed => self.cursor = Cursor::Fresh,
            _ => {}
        }
        true
    }

    /// Removes a subscription; returns its channel.
    pub fn unsubscribe(&mut self, id: u32) -> Option<u32> {
        let (channel, _) = self.subscriptions.remove(&id)?;
        self.rings.remove(&id);
        Some(channel)
    }

    /// Subscribed channels.
    pub fn channels(&self) -> impl Iterator<Item = u32> + '_ {
        self.subscriptions.values().map(|(channel, _)| *channel)
    }

    /// Queues a message of a channel; true if the channel is subscribed.
    pub fn offer(&mut self, channel: u32, message: &Entry) -> bool {
        let Some(id) = self.id_of(channel) else {
            return false;
        };
        let Some((_, Class::Newest { depth })) = self.subscriptions.get(&id) else {
            return false;
        };
        let ring = self.rings.entry(id).or_default();
        ring.push_back(message.clone());
        let mut bytes: usize = ring.iter().map(|message| message.cdr.len()).sum();
        while ring.len() > *depth || (bytes > MAX_RING_BYTES && ring.len() > 1) {
            let oldest = ring.pop_front();
            bytes = bytes.saturating_sub(oldest.map_or(0, |oldest| oldest.cdr.len()));
            self.dropped += 1;
        }
        true
    }

    /// Next message: control first, then the map and the other channels in turn.
    pub fn next(&mut self, stream: &mut MapStream) -> Option<Outgoing> {
        if self.overflown {
            self.control.clear();
            return Some(Outgoing::Close);
        }
        if let Some(message) = self.control.pop_front() {
            self.control_bytes = self.control_bytes.saturating_sub(message.bytes());
            return Some(message);
        }
        self.maps_turn = !self.maps_turn;
        match self.maps_turn {
            true => self.map(stream).or_else(|| self.newest()),
            false => self.newest().or_else(|| self.map(stream)),
        }
    }

    /// True if the map needs a keyframe to continue.
    pub fn waits_for_keyframe(&self) -> bool {
        self.waits_for_keyframe
    }

    /// Messages dropped for newer ones.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    fn map(&mut self, stream: &mut MapStream) -> Option<Outgoing> {
        let of = |class: Class| {
            let mut all = self.subscriptions.iter();
            let found = all.find(|(_, (_, other))| *other == class);
            found.map(|(id, _)| *id)
        };
        // With subscriptions to both forms the full one is sent.
        let either = |full: Class, thin: Class| match of(full) {
            Some(id) => Some((id, false)),
            None => of(thin).map(|id| (id, true)),
        };
        let maps = either(Class::Map, Class::ThinMap);
        let updates = either(Class::Updates, Class::ThinUpdates);
        if maps.is_none() && updates.is_none() {
            self.waits_for_keyframe = false;
            return None;
        }
        loop {
            let next = stream.next(&mut self.cursor);
            self.waits_for_keyframe = next == Next::Waits;
            let (id, entry) = match next {
                Next::Map(entry) => (maps, entry),
                Next::Update(entry) => (updates, entry),
                Next::Nothing | Next::Waits => return None,
            };
            match id {
                Some((id, true)) => return Some(Outgoing::Data(id, entry.thinned())),
                Some((id, false)) => return Some(Outgoing::Data(id, entry)),
                None => {}
            }
        }
    }

    fn newest(&mut self) -> Option<Outgoing> {
        let waiting = |(id, ring): (&u32, &VecDeque<Entry>)| (!ring.is_empty()).then_some(*id);
        let after = self.rings.range(self.turn.saturating_add(1)..);
        let id = after
            .chain(self.rings.range(..=self.turn))
            .find_map(waiting)?;
        self.turn = id;
        let entry = self.rings.get_mut(&id)?.pop_front()?;
        Some(Outgoing::Data(id, entry))
    }

    fn id_of(&self, channel: u32) -> Option<u32> {
        let mut all = self.subscriptions.iter();
        let found = all.find(|(_, (other, _))| *other == channel);
        found.map(|(id, _)| *id)
    }
}
