//! Messages played individually while paused, and the replies to the calls that requested them.

/// Pending messages of a call of `~/burst` or `~/play_next`.
pub(super) struct Steps {
    /// `None`: all.
    left: Option<u64>,
    played: u64,
    answer: Box<dyn FnOnce(u64) + Send>,
}

impl Steps {
    /// Requests `wanted` messages, or all; `answer` receives their final number.
    pub(super) fn new(wanted: Option<u64>, answer: impl FnOnce(u64) + Send + 'static) -> Self {
        Self {
            left: wanted,
            played: 0,
            answer: Box::new(answer),
        }
    }

    /// Counts a message; returns the rest, or replies if nothing is left.
    pub(super) fn played(mut self) -> Option<Self> {
        self.played += 1;
        self.left = self.left.map(|left| left.saturating_sub(1));
        match self.left {
            Some(0) => {
                self.end();
                None
            }
            _ => Some(self),
        }
    }

    /// Replies.
    pub(super) fn end(self) {
        (self.answer)(self.played);
    }
}
