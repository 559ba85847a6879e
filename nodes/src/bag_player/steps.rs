//! Messages played one by one while the player is paused, and the replies to the calls that asked for them.

/// Messages still to be played, of a call of `~/burst` or `~/play_next`.
pub(super) struct Steps {
    /// None: all.
    left: Option<u64>,
    played: u64,
    answer: Box<dyn FnOnce(u64) + Send>,
}

impl Steps {
    /// As many messages as `wanted`, all for none; `answer` is given how many there were.
    pub(super) fn new(wanted: Option<u64>, answer: impl FnOnce(u64) + Send + 'static) -> Self {
        Self {
            left: wanted,
            played: 0,
            answer: Box::new(answer),
        }
    }

    /// Counts a message; gives what is left, which answers where that is nothing.
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

    /// Answers.
    pub(super) fn end(self) {
        (self.answer)(self.played);
    }
}
