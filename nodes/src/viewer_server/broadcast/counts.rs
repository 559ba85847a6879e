//! Counters of the server.

use serde::Serialize;

/// Counters of the server.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct BroadcasterCounts {
    /// Clients accepted.
    pub clients_in: u64,
    /// Clients rejected at `max_clients`.
    pub clients_refused: u64,
    /// Clients closed because they read nothing for 20 s, or let too many replies accumulate.
    pub clients_stalled: u64,
    /// Connections closed before they became clients, to make room for newer ones.
    pub connections_displaced: u64,
    /// Connections whose TLS handshake failed or took longer than 5 s.
    pub tls_failed: u64,
    /// Connections without TLS to a server with TLS, redirected or refused.
    pub tls_plain: u64,
    /// Messages sent to clients.
    pub messages_out: u64,
    /// Bytes of these messages.
    pub bytes_out: u64,
    /// Messages dropped for newer ones.
    pub messages_dropped: u64,
    /// Restarts of the map for clients that fell behind.
    pub maps_restarted: u64,
}
