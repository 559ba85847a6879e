//! The session of a headset, as its topic and its meshes tell.

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

/// The session that holds and the one before.
#[derive(Default)]
pub(super) struct Session {
    now: Option<String>,
    before: Option<String>,
    /// Stamp of the newest mesh.
    newest_ns: Option<i64>,
}

impl Session {
    /// Takes the session from its own topic. The one before does not come back: what the node itself has
    /// published is heard late.
    pub fn on_topic(&mut self, text: &str) -> Told {
        if text.len() > MAX_TEXT {
            return Told::Ended;
        }
        match &self.now {
            Some(now) if now == text => Told::Same,
            _ if self.before.as_deref() == Some(text) => Told::Same,
            _ => self.begin(text),
        }
    }

    /// Takes the session of a mesh: the one before does not come back, and another begins only with a newer
    /// stamp.
    pub fn on_mesh(&mut self, text: &str, stamp_ns: i64) -> Told {
        if text.len() > MAX_TEXT {
            return Told::Ended;
        }
        let is_new = self.newest_ns.is_none_or(|newest_ns| stamp_ns > newest_ns);
        let told = match &self.now {
            _ if text.is_empty() => Told::Same,
            Some(now) if now == text => Told::Same,
            Some(_) if self.before.as_deref() == Some(text) || !is_new => return Told::Ended,
            _ => self.begin(text),
        };
        if is_new {
            self.newest_ns = Some(stamp_ns);
        }
        told
    }

    fn begin(&mut self, text: &str) -> Told {
        self.before = self.now.replace(text.to_owned());
        match self.before {
            Some(_) => Told::Another,
            None => Told::First,
        }
    }
}
