//! The session of a headset, as its topic and its meshes tell.

use std::collections::VecDeque;

/// Longest text of a session, bytes.
const MAX_TEXT: usize = 256;

/// Meaning of the session that a message names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Told {
    /// The one that is known, or none.
    Same,
    /// The first that is told.
    First,
    /// Another one: the origin is elsewhere.
    Another,
    /// One that has ended, or no text that is kept.
    Ended,
}

/// Longest delay of a message on its way from a headset.
pub(super) const MAX_DELAY_NS: i64 = 10_000_000_000;
/// Silence after which a session that had ended may go on, as of an application that was in the background.
const SILENT_NS: i64 = MAX_DELAY_NS;
/// Ended sessions that are known.
const MAX_ENDED: usize = 16;

/// The session that holds and those that have ended, told apart by their texts and by the time of arrival: the
/// clock of a headset may be set.
#[derive(Default)]
pub(super) struct Session {
    now: Option<String>,
    /// The newest last.
    ended: VecDeque<String>,
    /// Arrival of the newest mesh of the session that holds, ns of the node's clock.
    heard_ns: i64,
}

impl Session {
    /// Takes the session from its own topic. One that has ended does not come back: what the node itself has
    /// published is heard late.
    pub fn on_topic(&mut self, text: &str, now_ns: i64) -> Told {
        if text.len() > MAX_TEXT {
            return Told::Ended;
        }
        match &self.now {
            Some(now) if now == text => Told::Same,
            _ if self.has_ended(text) => Told::Same,
            _ => self.begin(text, now_ns),
        }
    }

    /// Takes the session of a mesh: one that has ended comes back only when the other has been silent.
    pub fn on_mesh(&mut self, text: &str, now_ns: i64) -> Told {
        if text.len() > MAX_TEXT {
            return Told::Ended;
        }
        let is_silent = now_ns.saturating_sub(self.heard_ns) > SILENT_NS;
        match &self.now {
            _ if text.is_empty() => Told::Same,
            Some(now) if now == text => {
                self.heard_ns = now_ns;
                Told::Same
            }
            Some(_) if self.has_ended(text) && !is_silent => Told::Ended,
            _ => self.begin(text, now_ns),
        }
    }

    fn has_ended(&self, text: &str) -> bool {
        self.ended.iter().any(|ended| ended == text)
    }

    fn begin(&mut self, text: &str, now_ns: i64) -> Told {
        self.heard_ns = now_ns;
        self.ended.retain(|ended| ended != text);
        let Some(before) = self.now.replace(text.to_owned()) else {
            return Told::First;
        };
        self.ended.push_back(before);
        if self.ended.len() > MAX_ENDED {
            self.ended.pop_front();
        }
        Told::Another
    }
}
