//! Counters of the server.

use serde::Serialize;

/// Counters of the server.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct BroadcasterCounts {
    /// Clients that were let in.
    pub clients_in: u64,
    /// Clients refused since all places were taken.
    pub clients_refused: u64,
    /// Clients that were closed: they took nothing for 20 s, or let too many answers wait.
    pub clients_stalled: u64,
    /// Connections that were closed before they were a client, to make room for newer ones.
    pub connections_displaced: u64,
    /// Messages given to clients.
    pub messages_out: u64,
    /// Their bytes.
    pub bytes_out: u64,
    /// Messages that gave way to newer ones.
    pub messages_dropped: u64,
    /// Times that a client was too slow for the map and got it anew.
    pub maps_restarted: u64,
}
