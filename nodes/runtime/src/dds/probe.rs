//! Waiting until discovery knows every writer made so far.
//!
//! RustDDS matches a new writer with the readers of its own participant that are there when discovery
//! takes the writer up. Nothing is delivered between the two, so a reliable reader never acknowledges:
//! the writer stalls as soon as its send window is full. A reader that comes later is not matched with
//! the writer. So readers wait here. The probe is a reader that is always there, and a writer made
//! for the wait: discovery takes writers up in turn, and their match is the sign.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use rustdds::{GUID, RTPSEntity};
use smol::Timer;
use smol::channel::{Sender, bounded};

use super::writer::RawWriter;
use crate::sync::lock;

/// Longest wait: discovery takes a writer up within milliseconds.
const PATIENCE: Duration = Duration::from_secs(2);

/// Matches of our endpoints with each other: those of probe writers end their waits.
#[derive(Default)]
pub(super) struct Probes {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    waiting: BTreeMap<GUID, Sender<()>>,
    /// Matched before the wait was there; at most [`MAX_EARLY`].
    early: Vec<GUID>,
}

/// Matches inside the participant that come before their wait, kept at most.
const MAX_EARLY: usize = 64;

impl Probes {
    /// An endpoint of ours is matched with another of ours.
    pub(super) fn matched(&self, endpoint: GUID) {
        let mut state = lock(&self.state);
        // The wait ends when its sender goes.
        if state.waiting.remove(&endpoint).is_none() {
            if state.early.len() >= MAX_EARLY {
                state.early.remove(0);
            }
            state.early.push(endpoint);
        }
    }

    /// Completes when the probe writer is matched, or after two seconds.
    pub(super) async fn wait(self: Arc<Self>, writer: RawWriter) {
        let guid = writer.guid();
        let (sender, matched) = bounded(1);
        {
            let mut state = lock(&self.state);
            if state.early.contains(&guid) {
                return;
            }
            state.waiting.insert(guid, sender);
        }
        let known = async { matched.recv().await.is_err() };
        let late = async {
            Timer::after(PATIENCE).await;
            false
        };
        if !smol::future::or(known, late).await {
            lock(&self.state).waiting.remove(&guid);
            log::warn!("discovery is slow: a subscription may hear its own process over DDS");
        }
    }
}
