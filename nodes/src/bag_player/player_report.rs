//! Report of a playback.

use serde::Serialize;

/// Result of a playback.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PlayerReport {
    /// Messages passed to the publishers.
    pub messages: u64,
    /// Messages skipped because a subscriber had not acknowledged earlier ones.
    pub failed: u64,
    /// Messages not acknowledged by reliable subscribers, at the end or when they left.
    pub unacknowledged: u64,
    /// Largest delay of a message, ms.
    pub latest_ms: u64,
    /// True if all reliable readers acknowledged all messages in time.
    pub acknowledged: bool,
}

impl PlayerReport {
    /// Summary of undelivered messages, if any.
    pub(super) fn losses(&self) -> Option<String> {
        let (failed, unacknowledged) = (self.failed, self.unacknowledged);
        (failed > 0 || unacknowledged > 0).then(|| {
            format!(
                "{failed} skipped for subscribers that do not acknowledge, {unacknowledged} not acknowledged"
            )
        })
    }
}
