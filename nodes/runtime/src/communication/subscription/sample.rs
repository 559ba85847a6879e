//! Received samples, and the counters of a subscription.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use lattice_msgs::{RosMessage, cdr};

use crate::logging::Throttle;
use crate::transport::peers::Peers;
use crate::transport::port::ReaderLosses;

/// Period of warnings about undecodable samples.
pub(super) const WARNING_PERIOD: Duration = Duration::from_secs(5);

/// Counters of a subscription.
pub(crate) struct Stats {
    pub(super) peers: Arc<Peers>,
    pub(super) received: AtomicU64,
    pub undecodable: AtomicU64,
    /// Lost messages, those of this process included.
    pub losses: ReaderLosses,
    warning: Throttle,
}

impl Stats {
    pub(crate) fn new(peers: Arc<Peers>, losses: ReaderLosses) -> Self {
        Self {
            peers,
            received: AtomicU64::new(0),
            undecodable: AtomicU64::new(0),
            losses,
            warning: Throttle::new(WARNING_PERIOD),
        }
    }

    pub(super) fn lost(&self) -> u64 {
        let ReaderLosses {
            on_network,
            overrun,
        } = &self.losses;
        on_network
            .load(Relaxed)
            .saturating_add(overrun.load(Relaxed))
    }

    /// Decodes a sample and counts the outcome.
    pub(crate) fn decode<M: RosMessage>(&self, sample: Sample<'_, M>) -> Option<Arc<M>> {
        let message = match sample {
            Sample::Shared(message) => Some(message),
            Sample::Cdr(bytes) => cdr::from_slice::<M>(bytes)
                .inspect_err(|why| self.not_decodable(why))
                .ok()
                .map(Arc::new),
        };
        if message.is_some() {
            self.received.fetch_add(1, Relaxed);
        }
        message
    }

    /// Takes the bytes of a sample without decoding.
    pub(crate) fn take_bytes(&self, sample: Sample<'_, Infallible>) -> Vec<u8> {
        self.received.fetch_add(1, Relaxed);
        match sample {
            Sample::Shared(never) => match *never {},
            Sample::Cdr(bytes) => std::mem::take(bytes),
        }
    }

    pub(super) fn not_decodable(&self, why: &dyn std::fmt::Display) {
        let count = self.undecodable.fetch_add(1, Relaxed).saturating_add(1);
        if self.warning.check().is_some() {
            let topic = self.peers.topic();
            log::warn!("{topic}: undecodable sample ({count} so far): {why}");
        }
    }
}

/// A message before decoding.
pub(crate) enum Sample<'a, M> {
    /// From this process.
    Shared(Arc<M>),
    /// From another process, encapsulation header first. The buffer may be taken.
    Cdr(&'a mut Vec<u8>),
}
