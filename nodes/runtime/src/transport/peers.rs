//! Matched peers of one endpoint, in this process and in others.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use super::port::EndpointId;
use crate::sync::{Changed, lock};

/// Limit of stored peers per endpoint.
const MAX_PEERS: usize = 4096;

/// Limit of warnings per endpoint: type names of peers are arbitrary.
const MAX_WARNINGS: usize = 16;

/// Called at each match; must return at once.
pub(crate) type OnJoined = Box<dyn FnMut() + Send>;

/// Matched peers of one publisher, subscription or server.
pub(crate) struct Peers {
    topic: String,
    peer_kind: &'static str,
    joins: log::Level,
    state: Mutex<State>,
    on_joined: Mutex<Vec<Arc<Mutex<OnJoined>>>>,
    joined: Changed,
}

#[derive(Default)]
struct State {
    remote: BTreeSet<EndpointId>,
    local: usize,
    /// Change counter at which `local` was counted.
    local_change: u64,
    incompatible: BTreeSet<EndpointId>,
    warned: BTreeSet<String>,
}

impl Peers {
    /// Peers of an endpoint: `peer_kind` names them in the log, `joins` is the level of match lines.
    pub(crate) fn new(topic: &str, peer_kind: &'static str, joins: log::Level) -> Self {
        Self {
            topic: topic.to_owned(),
            peer_kind,
            joins,
            state: Mutex::default(),
            on_joined: Mutex::default(),
            joined: Changed::default(),
        }
    }

    pub(crate) fn topic(&self) -> &str {
        &self.topic
    }

    /// Peers in other processes.
    pub(crate) fn remote(&self) -> usize {
        lock(&self.state).remote.len()
    }

    /// Completes with a remote peer that satisfies `wanted` once it is known.
    pub(crate) async fn known(&self, wanted: impl Fn(&EndpointId) -> bool) -> EndpointId {
        let known = || {
            let state = lock(&self.state);
            state.remote.iter().copied().find(&wanted)
        };
        self.joined.until(known).await
    }

    /// Peers in all processes.
    pub(crate) fn count(&self) -> usize {
        let state = lock(&self.state);
        state.remote.len().saturating_add(state.local)
    }

    /// Incompatible peers.
    pub(crate) fn incompatible_count(&self) -> usize {
        lock(&self.state).incompatible.len()
    }

    /// Calls `callback` at every match, and now if a peer is matched already.
    pub(crate) fn on_joined(&self, callback: OnJoined) {
        let callback = Arc::new(Mutex::new(callback));
        // Registered before counting: a concurrent match may call twice, but is never missed.
        lock(&self.on_joined).push(Arc::clone(&callback));
        if self.count() > 0 {
            lock(&callback)();
        }
    }

    /// Adds a matched peer of another process.
    pub(crate) fn add(&self, peer: EndpointId) {
        let mut state = lock(&self.state);
        state.incompatible.remove(&peer);
        if state.remote.len() >= MAX_PEERS || !state.remote.insert(peer) {
            return;
        }
        let count = state.remote.len().saturating_add(state.local);
        drop(state);
        self.joined(count);
    }

    /// Removes peers of other processes.
    pub(crate) fn remove(&self, gone: impl Fn(&EndpointId) -> bool) {
        let mut state = lock(&self.state);
        let before = state.remote.len();
        state.remote.retain(|peer| !gone(peer));
        state.incompatible.retain(|peer| !gone(peer));
        if state.remote.len() < before {
            let count = state.remote.len().saturating_add(state.local);
            drop(state);
            log::debug!("{}: {} gone ({count} left)", self.topic, self.peer_kind);
        }
    }

    /// Sets the number of local peers as of a change, unless a later change was
    /// counted already: counts are passed on outside their lock.
    pub(crate) fn set_local(&self, local: usize, change: u64) {
        let mut state = lock(&self.state);
        if change < state.local_change {
            return;
        }
        let grown = local > state.local;
        (state.local, state.local_change) = (local, change);
        let count = state.remote.len().saturating_add(local);
        drop(state);
        if grown {
            self.joined(count);
        }
    }

    /// Records a peer with incompatible QoS or type.
    pub(crate) fn incompatible(&self, peer: EndpointId, policy: &str) {
        let mut state = lock(&self.state);
        if state.incompatible.len() < MAX_PEERS {
            state.incompatible.insert(peer);
        }
        if state.warned.len() < MAX_WARNINGS && state.warned.insert(policy.to_owned()) {
            drop(state);
            log::warn!("{}", conflict(&self.topic, self.peer_kind, policy));
        }
    }

    fn joined(&self, count: usize) {
        let (topic, kind) = (&self.topic, self.peer_kind);
        log::log!(self.joins, "{topic}: {kind} matched ({count})");
        self.joined.notify();
        self.call_back();
    }

    /// Calls the callbacks as if the present peers had just matched.
    pub(crate) fn replay_match_events(&self) {
        if self.count() > 0 {
            self.call_back();
        }
    }

    fn call_back(&self) {
        // A callback may register another: not called under the lock.
        let callbacks = lock(&self.on_joined).clone();
        for callback in &callbacks {
            lock(callback)();
        }
    }
}

/// Warning about an incompatible peer; for publishers and subscriptions it begins as in rclcpp.
fn conflict(topic: &str, kind: &str, policy: &str) -> String {
    let remedy = format!("set qos.{topic}.* or the other side's QoS");
    match kind {
        _ if policy.starts_with("type") => {
            format!("{topic}: a {kind} does not match: {policy}; remap one of them")
        }
        "publisher" => format!(
            "New publisher discovered on topic '{topic}', offering incompatible QoS. No messages will be \
             received from it. Last incompatible policy: {policy}; {remedy}"
        ),
        "subscriber" => format!(
            "New subscription discovered on topic '{topic}', requesting incompatible QoS. No messages \
             will be sent to it. Last incompatible policy: {policy}; {remedy}"
        ),
        _ => format!("{topic}: a {kind} has incompatible QoS: {policy}; {remedy}"),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use futures::FutureExt;

    use super::*;

    fn peer(byte: u8) -> EndpointId {
        EndpointId([byte; 16])
    }

    #[test]
    fn joins_are_counted_and_called_once() {
        let peers = Peers::new("/map", "subscriber", log::Level::Info);
        let calls = Arc::new(AtomicUsize::new(0));
        peers.add(peer(1));
        let seen = Arc::clone(&calls);
        peers.on_joined(Box::new(move || {
            seen.fetch_add(1, Ordering::Relaxed);
        }));
        assert_eq!(calls.load(Ordering::Relaxed), 1, "one was there already");
        peers.add(peer(1));
        peers.add(peer(2));
        peers.set_local(1, 1);
        peers.set_local(0, 2);
        assert_eq!(calls.load(Ordering::Relaxed), 3);
        assert_eq!((peers.remote(), peers.count()), (2, 2));
        peers.remove(|p| *p == peer(1));
        assert_eq!(peers.count(), 1);
    }

    #[test]
    fn a_count_that_comes_late_is_not_believed() {
        let peers = Peers::new("/map", "subscriber", log::Level::Info);
        peers.set_local(2, 2);
        peers.set_local(1, 1);
        assert_eq!(peers.count(), 2);
    }

    #[test]
    fn each_who_waits_for_a_peer_hears_of_it() {
        let peers = Peers::new("/save_map", "reply reader", log::Level::Debug);
        let mut first = Box::pin(peers.known(|p| *p == peer(1)));
        let mut second = Box::pin(peers.known(|p| *p == peer(2)));
        assert!((&mut first).now_or_never().is_none());
        assert!((&mut second).now_or_never().is_none());
        peers.add(peer(2));
        assert!((&mut first).now_or_never().is_none(), "takes the only note");
        assert!(second.now_or_never().is_some());
    }

    #[test]
    fn a_callback_may_register_another() {
        let peers = Arc::new(Peers::new("/map", "subscriber", log::Level::Info));
        let again = Arc::clone(&peers);
        peers.on_joined(Box::new(move || again.on_joined(Box::new(|| {}))));
        peers.add(peer(1));
        assert_eq!(peers.count(), 1);
    }

    #[test]
    fn incompatible_peers_are_counted_until_they_go() {
        let peers = Peers::new("/points", "publisher", log::Level::Info);
        peers.incompatible(peer(1), "reliability");
        peers.incompatible(peer(1), "reliability");
        assert_eq!(peers.incompatible_count(), 1);
        peers.remove(|p| p.same_participant(&peer(1)));
        assert_eq!(peers.incompatible_count(), 0);
    }

    #[test]
    fn conflicts_are_told_as_rclcpp_tells_them() {
        let reliability = crate::transport::port::RELIABILITY_CONFLICT;
        let offered = conflict("/scan", "publisher", reliability);
        assert!(offered.starts_with(
            "New publisher discovered on topic '/scan', offering incompatible QoS. No messages will be \
             received from it. Last incompatible policy: RELIABILITY_QOS_POLICY ("
        ));
        assert!(offered.ends_with("; set qos./scan.* or the other side's QoS"));
        let durability = crate::transport::port::DURABILITY_CONFLICT;
        assert!(conflict("/map", "subscriber", durability).starts_with(
            "New subscription discovered on topic '/map', requesting incompatible QoS. No messages will \
             be sent to it. Last incompatible policy: DURABILITY_QOS_POLICY ("
        ));
        let other = conflict("/imu", "publisher", "type a, not b");
        assert_eq!(
            other,
            "/imu: a publisher does not match: type a, not b; remap one of them"
        );
    }
}
