//! Headset session, from its topic and its meshes.

use std::collections::VecDeque;

/// Longest text of a session, bytes.
const MAX_TEXT: usize = 256;

/// Effect of a session in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SessionUpdate {
    /// The current session, or none.
    Same,
    /// The first session.
    First,
    /// A new session with another origin.
    Another,
    /// An ended session, or an oversized text.
    Ended,
}

/// Longest message delay from a headset.
pub(super) const MAX_DELAY_NS: i64 = 10_000_000_000;
/// Silence after which an ended session may resume, such as that of an application in the background.
const SILENT_NS: i64 = MAX_DELAY_NS;
/// Number of ended sessions stored.
const MAX_ENDED: usize = 16;

/// Current and ended sessions, distinguished by text and arrival time: the
/// clock of a headset may be set.
#[derive(Default)]
pub(super) struct Session {
    now: Option<String>,
    /// Ended sessions, the newest last.
    ended: VecDeque<String>,
    /// Arrival of the newest mesh of the current session, ns of the node's clock.
    heard_ns: i64,
}

impl Session {
    /// Handles the session topic. An ended session does not resume: the node receives its own
    /// messages with a delay.
    pub fn on_topic(&mut self, text: &str, now_ns: i64) -> SessionUpdate {
        if text.len() > MAX_TEXT {
            return SessionUpdate::Ended;
        }
        match &self.now {
            Some(now) if now == text => SessionUpdate::Same,
            _ if self.has_ended(text) => SessionUpdate::Same,
            _ => self.begin(text, now_ns),
        }
    }

    /// Handles the session of a mesh: an ended one resumes only after a silence of the current one.
    pub fn on_mesh(&mut self, text: &str, now_ns: i64) -> SessionUpdate {
        if text.len() > MAX_TEXT {
            return SessionUpdate::Ended;
        }
        let is_silent = now_ns.saturating_sub(self.heard_ns) > SILENT_NS;
        match &self.now {
            _ if text.is_empty() => SessionUpdate::Same,
            Some(now) if now == text => {
                self.heard_ns = now_ns;
                SessionUpdate::Same
            }
            Some(_) if self.has_ended(text) && !is_silent => SessionUpdate::Ended,
            _ => self.begin(text, now_ns),
        }
    }

    fn has_ended(&self, text: &str) -> bool {
        self.ended.iter().any(|ended| ended == text)
    }

    fn begin(&mut self, text: &str, now_ns: i64) -> SessionUpdate {
        self.heard_ns = now_ns;
        self.ended.retain(|ended| ended != text);
        let Some(before) = self.now.replace(text.to_owned()) else {
            return SessionUpdate::First;
        };
        self.ended.push_back(before);
        if self.ended.len() > MAX_ENDED {
            self.ended.pop_front();
        }
        SessionUpdate::Another
    }
}
