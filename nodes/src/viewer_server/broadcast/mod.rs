//! Distribution of messages to the clients.

mod bridge;
mod broadcaster;
mod client;
mod counts;
mod graph;
mod map_stream;
mod outbox;
pub mod thin;
mod watched;

pub use bridge::Bridge;
pub use broadcaster::{Broadcaster, Demand};
pub use counts::BroadcasterCounts;
pub use graph::ConnectionGraph;
pub use map_stream::{Cursor, Entry, MapStream, Next, entry};
pub use outbox::{Class, Outbox, Outgoing};
