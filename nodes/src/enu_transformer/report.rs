//! Report of an `enu_transformer` at its end.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::TransformerCounts;

/// The end of an `enu_transformer`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformerReport {
    /// Everything counted by the state machine.
    pub counts: TransformerCounts,
    /// Clouds that were sent and lost on the way, or that found the inbox full.
    pub clouds_inbox_full: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Clouds that could not be given to the publisher.
    pub clouds_not_published: u64,
}

impl TransformerReport {
    /// Clouds lost by reason, zeros left out.
    pub fn dropped(&self) -> BTreeMap<String, u64> {
        let own = [
            ("inbox_full", self.clouds_inbox_full),
            ("undecodable", self.undecodable),
            ("not_published", self.clouds_not_published),
        ];
        let reasons = self.counts.reasons().into_iter().chain(own);
        reasons
            .filter(|(_, count)| *count > 0)
            .map(|(reason, count)| (reason.to_owned(), count))
            .collect()
    }
}
